#!/usr/bin/env python3
"""Checks includes: the order of the modules, and where third-party libraries may appear.

    tools/check_layers.py               check the tree; exit status 1 and one line for each violation
    tools/check_layers.py --self-test   check the checker

Reads only the #include lines. A quoted include names a file from the root of the repository. Tests may include everything.
"""
import collections
import os
import pathlib
import re
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent

# The order of modules is core <- {geo, tin}; geo <- DEM <- dem; {geo, tin} <- proto; {dem, proto} <- tiler <- archive
# <- {bake, server}, and core <- config <- server (config may also include VALUES). In the server, asio.h is below all modules, the files of the folder
# itself combine the modules, and the command line is above all: net <- http, which do not depend on terrain; jobs; store,
# jobs <- tiles; http <- query <- api; {http, tiles} <- {telemetry, api}; {telemetry, api} <- access; api <- documents
# <- handlers; {access, handlers} <- server <- cli, and tiles <- reload <- cli. In the command line common <- {serve,
# mesh, info, bake, fly} <- cli, bake <- cli/bake, and fly <- cli/fly.
TIN = ["engine/tin/mesh", "engine/tin/scan", "engine/tin", "engine/tin/extended", "engine/tin/decimate"]
GEOMETRY = ["engine/core", "engine/geo"] + TIN
PROTO = ["proto", "proto/mesh", "proto/error", "proto/gltf", "proto/documents"]
CONFIG = ["config/common", "config", "config/input", "config/options", "config/file"]
TILER_OF = {"tiler/map": [], "tiler/mesh": [], "tiler/tile": ["tiler/map"], "tiler/area": ["tiler/map", "tiler/tile", "tiler/mesh"],
            "tiler/store": ["tiler/map", "tiler/tile"], "tiler/surface": ["tiler/map", "tiler/tile", "tiler/mesh", "tiler/store"]}
TILER = [*TILER_OF, "tiler"]
ENGINE = GEOMETRY + ["engine/dem"] + PROTO + ["config"] + TILER + ["archive", "server/asio"]
ARCHIVE = ["archive/files", "archive/pmtiles", "archive"]
# Modules of elevation models: each may include those before it.
DEM = ["engine/common", "engine/gdal", "engine/crs", "engine/raster", "engine/statistics", "engine/sources", "engine/mosaic", "engine/sight",
       "engine/bound", "engine/edits", "engine/image", "engine/export"]
# Rows (name, folder, headers): a module that may include the module `name` may also include these headers of the modules in `folder`.
PUBLIC_HEADERS = {folder + "/" + name: front for front, folder, names in (
    ("engine/dem", "engine", ("common/box_index.h", "common/content_hash.h", "common/averages_budget.h", "common/dem_types.h", "common/file_stamp.h", "common/idle_pool.h", "common/lru_block_cache.h", "common/parallel_for.h", "crs/geodesic_path.h", "edits/edit_effects.h",
                              "export/contour_lines.h", "export/output_grid.h", "gdal/file_content.h", "gdal/stamped_files.h", "gdal/gdal_runtime.h", "gdal/remote_file.h",
                              "gdal/source_policy.h", "image/imagery.h", "image/raster_colors.h", "image/water_raster.h", "sight/quadratic.h",
                              "sight/ray_course.h", "sight/sight_ray.h", "sight/sight_search.h",
                              "sources/read_raster.h", "statistics/cache_folder.h")),
    ("config", "config", ("config.h", "common/cache_place.h", "common/listen_address.h", "common/token_hash.h",
                          "common/working_directory.h", "options/options.h")),
) for name in names}
# Plain values in the configuration's structs, and their names: config may include nothing else of these modules.
VALUES = {"engine/common/dem_types.h", "engine/tin/criterion.h", "proto/gltf/gltf_names.h", "proto/gltf/gltf_types.h"}
# The client that flies: scene <- select; {select, content} <- tree; {tree, http} <- flight <- report <- cli/fly.
FLY = ["fly/scene", "fly/select", "fly/content", "fly/tree", "fly/http", "fly/flight", "fly/report"]
HTTP = ["server/net", "server/http"]
TILES = ENGINE + ["server/jobs", "server/tiles"]
API = TILES + HTTP + ["server/query", "server/openapi", "server/api"]
SERVER = API + ["server/store", "server/telemetry", "server/access", "server/documents", "server/handlers"]
MODULES = {
    "engine/core": [],
    "engine/geo": ["engine/core"],
    "engine/tin/mesh": ["engine/core"],
    "engine/tin/scan": ["engine/core", "engine/tin/mesh"],
    "engine/tin": ["engine/core", "engine/tin/mesh", "engine/tin/scan"],
    "engine/tin/extended": ["engine/core", "engine/tin/mesh", "engine/tin/scan", "engine/tin"],
    "engine/tin/decimate": ["engine/core", "engine/tin/mesh", "engine/tin/scan", "engine/tin"],
    **{module: ["engine/core", "engine/geo"] + DEM[:i] for i, module in enumerate(DEM)},
    "engine/dem": ["engine/core", "engine/geo"] + DEM,
    "proto": GEOMETRY,
    **{module: GEOMETRY + PROTO[:i] for i, module in enumerate(PROTO) if i > 0},
    **{module: ["engine/core"] + CONFIG[:i] for i, module in enumerate(CONFIG)},
    **{module: GEOMETRY + ["engine/dem"] + PROTO + others for module, others in {**TILER_OF, "tiler": [*TILER_OF]}.items()},
    "archive/files": ["engine/core", "engine/dem"] + PROTO,
    "archive/pmtiles": ["engine/core", "engine/dem"] + PROTO + TILER + ["archive/files"],
    "archive": GEOMETRY + ["engine/dem"] + PROTO + TILER + ARCHIVE[:2],
    "bake/queue": ["engine/core", "redis"],
    "bake": GEOMETRY + ["engine/dem"] + PROTO + TILER + ARCHIVE + ["bake/queue"],
    "redis": ["engine/core"],
    "fly/scene": ["engine/core", "engine/geo"],
    "fly/select": ["engine/core", "engine/geo", "fly/scene"],
    "fly/content": ["engine/core"],
    "fly/tree": ["engine/core", "engine/geo", "fly/scene", "fly/select", "fly/content"],
    "fly/http": ["engine/core"],
    "fly/flight": ["engine/core", "engine/geo"] + FLY[:5],
    "fly/report": ["engine/core", "engine/geo"] + FLY[:6],
    "server/cli/fly": ["engine/core", "server/cli/common"] + FLY,
    "server/asio": [],
    "server/jobs": ["engine/core", "server/asio"],
    "server/net": ["engine/core", "server/asio"],
    "server/http": ["engine/core", "server/asio", "server/net"],
    "server/store": ["engine/core", "engine/geo", "config", *TILER, "archive", "redis"],
    "server/tiles": ENGINE + ["server/jobs"],
    "server/telemetry": TILES + HTTP,
    "server/query": ENGINE + ["server/http"],
    "server/openapi": [],
    "server/api": TILES + HTTP + ["server/query", "server/openapi"],
    "server/access": API + ["server/telemetry"],
    "server/documents": API,
    "server/handlers": API + ["server/documents"],
    "server/reload": ENGINE + ["config/file", "server/tiles"],
    "server": SERVER,
    "server/cli/common": SERVER + ["server", "server/reload"],
    **{"server/cli/" + command: SERVER + ["config/file", "server", "server/reload", "server/cli/common"] for command in ("serve", "mesh", "info")},
    "server/cli/bake": ENGINE + ["config/file", "archive/files", "redis", "bake/queue", "bake", "server/store", "server/cli/common"],
    "server/cli": SERVER + ["server", "server/cli/common", "server/cli/serve", "server/cli/mesh", "server/cli/info", "server/cli/bake", "server/cli/fly"],
}

# Library: its headers, and the files that may include them (regular expressions on paths). The first match counts.
Library = collections.namedtuple("Library", "name headers files")
DEM_FILES = r"engine/(?!core/|geo/|tin/)\w+"  # of the modules of DEM, and of engine/dem
LIBRARIES = [
    Library("expected", r"tl/.*", r"."),
    Library("fmt", r"fmt/.*", r"."),
    Library("Highway", r"hwy/.*", r"(engine/(bound|crs|gdal|geo|raster|statistics|tin)|proto/(error|mesh))/.*(\.cc|-inl\.h)"),
    Library("GDAL", r"(gdal|cpl|ogr|vrt)\w*\.h|(proj|geodesic)\.h", r"(engine/(gdal|crs|raster|statistics|sources|image|export)/|archive/files/bucket\.cc)"),
    Library("nlohmann_json", r"nlohmann/.*", r"(config/|engine/edits/|(archive|bake|fly|proto|server)/.*\.cc)"),
    Library("libdeflate", r"libdeflate\.h", r"(proto/.*|fly/content/gunzip)\.cc"),
    Library("brotli", r"brotli/.*", r"proto/.*\.cc"),
    Library("zstd", r"zstd\.h", r"proto/.*\.cc"),
    Library("zlib", r"zlib\.h", r"proto/(compress|codec_versions)\.cc"),
    Library("Draco", r"draco/.*", r"(proto/.*|fly/content/glb)\.cc"),
    Library("libjpeg", r"jpeglib\.h", r"proto/.*\.cc"),
    Library("protozero", r"protozero/.*", r"proto/.*\.cc"),
    Library("libwebp", r"webp/.*", r"proto/.*\.cc"),
    Library("meshoptimizer", r"meshoptimizer\.h", r"proto/.*\.cc"),
    Library("hiredis", r"hiredis/.*", r"redis/.*\.cc"),
    Library("RocksDB", r"rocksdb/.*", r"server/store/record_db\.cc"),
    Library("xxHash", r"xxhash\.h", rf"({DEM_FILES}|engine/tin|proto|tiler|archive|bake|server)/.*\.cc"),
    Library("spdlog", r"spdlog/.*", rf"({DEM_FILES}|server)/.*\.cc"),
    Library("Beast", r"boost/beast.*", r"(server/http/request|fly/http/http_client)\.cc"),
    Library("OpenSSL", r"openssl/.*|boost/asio/ssl.*", r"(config/common/token_hash|archive/files/zip_writer|fly/http/http_client|redis/socket|server/net/.*)\.cc"),
    Library("GEOS", r"geos_c\.h", r"engine/edits/.*\.cc"),
    Library("Boost.Geometry", r"boost/geometry/.*", r"engine/common/.*\.cc"),
    Library("Boost.JSON", r"boost/json.*", r"server/query/json_parameters\.cc"),
    Library("Boost", r"boost/.*", r"(server/|fly/http/http_client\.cc|fly/flight/)"),
    Library("CLI11", r"CLI/.*", r"server/cli/"),
    Library("systemd", r"systemd/.*", r"server/cli/.*\.cc"),
    Library("prometheus-cpp", r"prometheus/.*", r"server/.*\.cc"),
    # Libraries that a module promises not to use: threads and clocks, files, sockets.
    Library("threads", r"(thread|mutex|shared_mutex|condition_variable|semaphore|future)", rf"({DEM_FILES}|tiler/store|archive|bake|fly/(flight|http)|server)/|redis/resolver\.cc"),
    Library("clocks", r"(chrono|ctime)", rf"(config|bake|fly/(flight|http)|tiler|redis|server|{DEM_FILES})/|engine/core/elapsed_time\.h"),
    Library("files", r"(filesystem|fstream)", rf"(config/|{DEM_FILES}/|archive/|bake/|server/|proto/gltf/mesh_file)"),
    Library("memory from the system", r"sys/mman\.h|sanitizer/asan_interface\.h", r"(engine/tin/mesh/spare_blocks|server/.*)\.cc"),
    Library("the operating system", r"(unistd|malloc|fcntl|dlfcn|poll|glob|signal|dirent|pthread|elf|link|netdb)\.h|(sys|arpa|netinet|linux)/.*",
            rf"(config|{DEM_FILES}|tiler|archive|bake|redis|server)/.*\.cc"),
    Library("the standard library", r"[a-z_0-9]+|(stdint|immintrin)\.h", r"."),
]

# These may appear in headers that other modules include. So may Boost inside the server (awaitable results), GDAL
# between the modules of DEM, and JSON between those of config.
PUBLIC = {"expected", "fmt", "the standard library", "threads", "clocks", "files"}

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(?:<([^>\n]+)>|"([^"\n]+)")', re.MULTILINE)


def module_of(path):
    """The module of a file: the file itself, or the longest module that is a folder of its path."""
    modules = [module for module in MODULES if path == module or path.startswith(module + "/")]
    return max(modules, key=len, default=None)


def library_of(header):
    return next((library for library in LIBRARIES if re.fullmatch(library.headers, header)), None)


class Tree:
    def __init__(self, root):
        self.sources = {}  # path -> [(line, header or None, quoted path or None)]
        for module in sorted({module.split("/")[0] for module in MODULES}):
            for folder, folders, names in os.walk(root / module):
                folders[:] = sorted(set(folders) - {"node_modules"})
                for name in sorted(names):
                    if name.endswith((".h", ".cc")):
                        path = pathlib.Path(folder, name)
                        self.sources[path.relative_to(root).as_posix()] = self.includes(path)

    @staticmethod
    def includes(path):
        text = path.read_text(encoding="utf-8")
        return [(text.count("\n", 0, match.start(1) if match[1] else match.start(2)) + 1, match[1], match[2])
                for match in INCLUDE.finditer(text)]

    def libraries_behind(self, path, seen=None):
        """Names of all libraries that including `path` includes."""
        seen = set() if seen is None else seen
        names = set()
        if path in seen:
            return names
        seen.add(path)
        for _, header, quoted in self.sources.get(path, []):
            if quoted:
                names |= self.libraries_behind(quoted, seen)
            elif library := library_of(header):
                names.add(library.name)
        return names

    def violations(self):
        for path, includes in self.sources.items():
            for line, header, quoted in includes:
                message = self.judge(path, quoted) if quoted else self.judge_library(path, header)
                if message:
                    yield f"{path}:{line}: {message}"

    def judge(self, path, quoted):
        if quoted not in self.sources:
            return f'"{quoted}" is no file of a module: name it from the root of the repository'
        module, other = module_of(path), module_of(quoted)
        if module is None or other is None:
            return f'"{quoted}": {path if module is None else quoted} lies in no module; add its folder to MODULES'
        if module == other:
            return None
        if PUBLIC_HEADERS.get(quoted) in MODULES[module]:
            other = PUBLIC_HEADERS[quoted]
        if other not in MODULES[module] and not (module in CONFIG and quoted in VALUES):
            return f'{module} may not know {other} ("{quoted}")'
        public = PUBLIC - ({"clocks"} if module in GEOMETRY + PROTO else set()) | ({"Boost"} if module.startswith("server") and other.startswith("server") else set())
        public |= {"GDAL", "Boost.Geometry"} if other in DEM and module in [*DEM, "engine/dem"] else set()
        public |= {"nlohmann_json"} if module in CONFIG and other in CONFIG else set()
        hidden = self.libraries_behind(quoted) - public
        if hidden:
            return f'"{quoted}" shows {", ".join(sorted(hidden))} to {module}: keep it in .cc files or in headers of {other} alone'
        return None

    @staticmethod
    def judge_library(path, header):
        library = library_of(header)
        if library is None:
            return f"<{header}> belongs to no known library; add it to LIBRARIES"
        if not re.match(library.files, path):
            return f"{library.name} (<{header}>) may not appear here"
        return None


class SelfTest(unittest.TestCase):
    def check(self, files):
        with tempfile.TemporaryDirectory() as folder:
            for path, text in files.items():
                file = pathlib.Path(folder, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, encoding="utf-8")
            return list(Tree(pathlib.Path(folder)).violations())

    def assert_clean(self, files):
        self.assertEqual(self.check(files), [])

    def assert_refused(self, files, part):
        found = self.check(files)
        self.assertEqual(len(found), 1, found)
        self.assertIn(part, found[0])

    def test_arrows_allowed(self):
        self.assert_clean({
            "engine/core/result.h": "#include <tl/expected.hpp>\n",
            "engine/geo/key.h": '#include "engine/core/result.h"\n',
            "engine/dem/source.h": '#include "engine/geo/key.h"\n#include <stop_token>\n',
            "server/tiles/pipeline.h": '#include "engine/dem/source.h"\n',
            "server/api/router.cc": '#include "server/tiles/pipeline.h"\n',
        })

    def test_arrows_refused(self):
        for user, used in (("engine/core", "engine/geo"), ("engine/tin", "engine/geo"), ("engine/geo", "engine/tin"),
                           ("proto", "engine/dem"), ("engine/dem", "proto"), ("engine/gdal", "engine/crs"), ("engine/export", "engine/dem"),
                           ("config", "engine/geo"), ("engine/tin", "server/tiles"),
                           ("server/tiles", "server/http"), ("server/http", "server/tiles"), ("server/http", "tiler"), ("server/http", "server/api"),
                           ("server/jobs", "server/tiles"), ("server/jobs", "tiler"), ("server/net", "server/http"), ("server/api", "server/handlers"),
                           ("server/handlers", "server/cli"), ("tiler/tile", "tiler/store"), ("tiler/surface", "tiler"),
                           ("server/tiles", "server")):
            with self.subTest(user=user, used=used):
                self.assert_refused({f"{used}/b.h": "", f"{user}/a.cc": f'#include "{used}/b.h"\n'}, f"{user} may not know {used}")

    def test_config_knows_plain_values_alone(self):
        self.assert_clean({"proto/gltf/gltf_types.h": "", "config/a.h": '#include "proto/gltf/gltf_types.h"\n'})
        self.assert_refused({"proto/gltf/glb_tile.h": "", "config/a.h": '#include "proto/gltf/glb_tile.h"\n'}, "config may not know proto")
        found = self.check({"engine/common/dem_types.h": "#include <gdal.h>\n", "config/a.h": '#include "engine/common/dem_types.h"\n'})
        self.assertEqual(len(found), 2, found)
        self.assertIn("shows GDAL to config", found[0])
        self.assertIn("GDAL (<gdal.h>) may not appear here", found[1])

    def test_other_modules_see_only_public_headers(self):
        self.assert_clean({"config/options/options.h": "", "server/cli/serve/a.cc": '#include "config/options/options.h"\n'})
        self.assert_refused({"config/input/config_location.h": "", "server/cli/serve/a.cc": '#include "config/input/config_location.h"\n'},
                            "server/cli/serve may not know config/input")
        self.assert_refused({"server/cli/serve/log.h": "", "server/cli/mesh/a.cc": '#include "server/cli/serve/log.h"\n'},
                            "server/cli/mesh may not know server/cli/serve")

    def test_line_is_named(self):
        self.assert_refused({"engine/geo/b.h": "", "engine/core/a.h": '// first\n\n#  include "engine/geo/b.h"\n'}, "engine/core/a.h:3:")

    def test_unknown_file_and_folder(self):
        self.assert_refused({"engine/geo/a.cc": '#include "key.h"\n'}, "is no file of a module")
        self.assert_refused({"engine/a.h": "", "engine/geo/b.cc": '#include "engine/a.h"\n'}, "lies in no module")

    def test_libraries_stay_in_their_places(self):
        for path, header in (("engine/tin/a.cc", "gdal_priv.h"), ("server/tiles/a.cc", "gdal.h"), ("proto/a.cc", "cpl_conv.h"),
                             ("server/http/router.cc", "boost/beast/http.hpp"), ("server/http/session.h", "boost/beast.hpp"),
                             ("engine/dem/a.cc", "boost/asio.hpp"), ("proto/a.h", "nlohmann/json.hpp"),
                             ("server/tiles/a.cc", "CLI/CLI.hpp"), ("engine/tin/a.h", "thread"), ("engine/geo/a.h", "chrono"),
                             ("proto/a.cc", "sys/socket.h"), ("engine/tin/a.h", "hwy/highway.h"), ("server/cli/a.h", "spdlog/spdlog.h")):
            with self.subTest(path=path, header=header):
                self.assert_refused({path: f"#include <{header}>\n"}, "may not appear here")

    def test_libraries_in_their_places(self):
        self.assert_clean({
            "engine/gdal/handle.h": "#include <gdal_priv.h>\n#include <mutex>\n",
            "engine/dem/source.cc": '#include "engine/gdal/handle.h"\n#include <sys/stat.h>\n',
            "server/http/request.cc": "#include <boost/beast/http.hpp>\n#include <boost/asio/awaitable.hpp>\n",
            "server/cli/main.cc": "#include <CLI/CLI.hpp>\n",
            "proto/compress.cc": "#include <libdeflate.h>\n#include <vector>\n",
            "engine/tin/scan-inl.h": "#include <hwy/highway.h>\n",
            "engine/tin/scan.cc": '#include <hwy/highway.h>\n#include <stop_token>\n#include "engine/tin/scan-inl.h"\n',
        })

    def test_library_shown_through_another_header(self):
        self.assert_refused({
            "engine/gdal/handle.h": "#include <gdal.h>\n",
            "engine/dem/source.h": '#include "engine/gdal/handle.h"\n',
            "server/tiles/pipeline.cc": '#include "engine/dem/source.h"\n',
        }, "shows GDAL to server/tiles")

    def test_boost_crosses_modules_of_the_server(self):
        self.assert_clean({
            "server/asio/asio.h": "#include <boost/asio/awaitable.hpp>\n",
            "server/tiles/service.h": '#include "server/asio/asio.h"\n',
            "server/api/router.h": '#include "server/tiles/service.h"\n',
        })

    def test_unknown_library(self):
        self.assert_refused({"proto/a.cc": "#include <rapidjson/document.h>\n"}, "belongs to no known library")


def main():
    if sys.argv[1:] == ["--self-test"]:
        unittest.main(argv=sys.argv[:1])
    tree = Tree(ROOT)
    found = list(tree.violations())
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{len(tree.sources)} files, {len(found)} violations")
    return 1 if found or not tree.sources else 0


if __name__ == "__main__":
    sys.exit(main())
