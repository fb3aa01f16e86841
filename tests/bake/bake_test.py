"""The baker as a user runs it: bake_test.py BINARY [--long]. --long: 200 kills instead of 20."""
import contextlib
import http.client
import json
import math
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import time
import unittest

from bake_case import BINARY, IS_LONG, BakeCase, files_of, write_hgt
from pmtiles import archive, bounds_of, tiles_of
from srtm import write_asc

KILLS = 200 if IS_LONG else 20


class Bake(BakeCase):
    THREADS = 2

    def start(self, *arguments, config=None):
        return self.begin(self.command(*arguments, config=config))

    @contextlib.contextmanager
    def server(self, *what):
        process = subprocess.Popen([BINARY, "serve", *(what or ("--config", self.config)), "--listen", "127.0.0.1:0"], env=self.environment,
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            port = int(re.search(r"127\.0\.0\.1:(\d+)", process.stdout.readline())[1])
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)

            def get(path, headers={}):
                connection.request("GET", f"/cells/{path}", headers=headers)
                reply = connection.getresponse()
                return reply.status, reply.read()
            yield get
            connection.close()
        finally:
            process.kill()
            process.communicate()

    def test_every_tile_equals_the_live_one(self):
        place = self.place("formats")
        done = self.run_bake("--out", place, "--format", "terrain,glb,png", levels="0-8")
        self.assertEqual(done.returncode, 0, done.stderr)
        accept = {"Accept": "application/vnd.quantized-mesh;extensions=octvertexnormals", "Accept-Encoding": "gzip"}
        with self.server() as get:
            for folder, path, headers in (("terrain", "{}/{}/{}.terrain", accept), ("glb", "{}/{}/{}.glb", {}),
                                          ("png", "{}/{}/{}.png", {})):
                manifest, tiles = archive(place / folder, geodetic=folder != "png")
                self.assertEqual(len(tiles), sum(unit["tiles"] for unit in manifest["units"]))
                self.assertGreater(len(tiles), 50)
                for key, tile in tiles.items():
                    if folder == "glb":
                        status, body = get(self.glb_path(get, key), headers)
                    else:
                        status, body = get(path.format(*key), headers)
                    self.assertEqual((status, body == tile), (200, True), (folder, key))

    def glb_path(self, get, key):
        if not hasattr(self, "roots"):
            tileset = json.loads(get("tileset.json", {})[1])
            uris = re.findall(r'"([^"]*\{level\}[^"]*\.glb[^"]*)"', json.dumps(tileset))
            self.roots = [uri.split("?")[0] for uri in uris]
        level, x, y = key
        for uri in self.roots:
            root_level, root_x, root_y = (int(number) for number in re.search(r"3dtiles/(\d+)-(\d+)-(\d+)/", uri).groups())
            down = level - root_level
            if down >= 0 and x >> down == root_x and y >> down == root_y:
                return (uri.replace("{level}", str(down)).replace("{x}", str(x - (root_x << down)))
                        .replace("{y}", str(y - (root_y << down))))
        return f"{level}/{x}/{y}.glb"

    def test_threads_do_not_matter(self):
        for threads in (1, 4):
            place = self.place(threads)
            self.assertEqual(self.run_bake("--out", place, "--threads", threads).returncode, 0)
            self.expect_equal(place)

    def test_killed_at_any_moment_it_goes_on_to_the_same_files(self):
        place, kept = self.place("killed"), 0
        dice = random.Random(7)
        for kill in range(KILLS):
            if (place / "manifest.json").exists():
                # If it was killed after the manifest and before the removal of its notes, the next run removes them.
                self.assertEqual(self.run_bake("--out", place).returncode, 0)
                self.expect_equal(place)
                shutil.rmtree(place)
            process = self.start("--out", place, "--threads", dice.choice((1, 2)), "--json")
            if kill % 2:
                process.stdout.readline()  # a unit is finished, also where the machine is slower than it was for self.seconds
            time.sleep(dice.uniform(0, self.seconds / 2))
            process.kill()
            kept += process.communicate()[0].count('"kept"')
        self.assertGreater(kept, 0, "no kill left a finished unit")
        done = self.run_bake("--out", place)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.expect_equal(place)

    def test_killed_after_the_manifest_the_next_run_removes_the_notes(self):
        place = self.place("notes")
        begun = self.start("--out", place, "--json", "--threads", 1)
        begun.stdout.readline()
        begun.kill()
        begun.communicate()
        shutil.copytree(self.reference, place, dirs_exist_ok=True)
        self.assertLessEqual({"bake.json", "bake.lock"}, set(files_of(place)))
        done = self.run_bake("--out", place, "--json")
        self.assertEqual((done.returncode, set(self.units(done).values())), (0, {"kept"}), done.stderr)
        self.expect_equal(place)

    def test_signals_drop_the_unit_and_say_how_to_go_on(self):
        for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
            place = self.place(code)
            process = self.start("--out", place, "--json", "--threads", 1)
            process.stdout.readline()  # the first unit
            process.send_signal(number)
            _, errors = process.communicate(timeout=60)
            self.assertEqual(process.returncode, code)
            self.assertIn("run the same command again to go on", errors)
            self.assertFalse((place / "manifest.json").exists())
            self.assertEqual([name for name in files_of(place) if name.endswith((".partial", ".lock"))], [])
            done = self.run_bake("--out", place, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("kept", self.units(done).values())
            self.expect_equal(place)

    def test_a_unit_that_fails_is_listed_and_the_others_are_baked(self):
        place = self.place("limit")
        sizes = {unit["name"]: unit["bytes"] for unit in json.loads((self.reference / "manifest.json").read_text())["units"]}
        limit = max(sizes.values()) - 1
        done = self.run_bake("--out", place, "--json",
                             preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
        self.assertEqual(done.returncode, 1, done.stderr)
        failed = [unit for unit, outcome in self.units(done).items() if outcome == "failed"]
        self.assertIn(max(sizes, key=sizes.get), failed)
        self.assertLess(len(failed), len(sizes))
        for unit in failed:
            self.assertIn(f"unit {unit} of terrain failed", done.stderr)
        self.assertFalse((place / "manifest.json").exists())
        self.assertEqual(self.run_bake("--out", place).returncode, 0)
        self.expect_equal(place)

    def test_damaged_and_foreign_units_are_baked_again(self):
        place = self.place("damaged")
        begun = self.start("--out", place, "--json", "--threads", 1)
        begun.stdout.readline()
        begun.kill()
        begun.communicate()
        shutil.copytree(self.reference, place, dirs_exist_ok=True, ignore=shutil.ignore_patterns("manifest.json"))
        units = sorted((place / "units").glob("*.pmtiles"))
        data = bytearray(units[0].read_bytes())
        data[len(data) // 2] ^= 1
        units[0].write_bytes(data)
        units[1].write_bytes(units[1].read_bytes()[:-1])
        shutil.copy(units[3], units[2])
        done = self.run_bake("--out", place, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({unit for unit, outcome in self.units(done).items() if outcome == "baked"},
                         {unit.stem for unit in units[:3]})
        self.expect_equal(place)

    def test_update_bakes_the_units_that_a_source_touches(self):
        config = self.make_sources("changed", (0, 0, 0, 1))
        fresh, updated = self.place("fresh"), self.place("updated")
        self.assertEqual(self.run_bake("--out", fresh, config=config).returncode, 0)
        done = self.run_bake("--out", updated, "--update", self.reference, "--json", config=config)
        self.assertEqual(done.returncode, 0, done.stderr)
        baked = {unit for unit, outcome in self.units(done).items() if outcome == "baked"}
        self.assertIn("top", baked)
        for unit in baked - {"top"}:
            south = int(unit.split("-")[2]) * 180 / 128 - 90
            self.assertTrue(27 < south < 32, unit)  # around N30E012; the other cells lie 15 degrees to the north
        self.assertGreater(len(baked), 2)
        self.assertEqual({outcome for unit, outcome in self.units(done).items() if unit not in baked}, {"copied"})
        self.expect_equal(updated, fresh)

    def test_update_takes_the_formats_that_a_changed_option_does_not_concern(self):
        formats = ("--format", "terrain,glb,png")
        older, newer = self.place("older"), self.place("newer")
        self.assertEqual(self.run_bake("--out", older, *formats, levels="0-8").returncode, 0)
        config = self.make_sources("thanked")
        options = json.loads(config.read_text())
        options["datasets"][0]["attribution"] = "swisstopo"
        config.write_text(json.dumps(options))
        done = self.run_bake("--out", newer, "--update", older, *formats, "--json", config=config, levels="0-8")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        self.assertEqual({(line["format"], line["outcome"]) for line in lines if "unit" in line},
                         {("terrain", "copied"), ("glb", "baked"), ("png", "copied")})
        fresh = self.place("fresh")
        self.assertEqual(self.run_bake("--out", fresh, *formats, config=config, levels="0-8").returncode, 0)
        self.expect_equal(newer, fresh)

    def test_update_takes_the_formats_of_a_bake_killed_between_their_manifests(self):
        killed, updated = self.place("killed"), self.place("updated")
        formats = ("--format", "terrain,glb")
        self.assertEqual(self.run_bake("--out", killed, *formats, levels="0-8").returncode, 0)
        (killed / "glb/manifest.json").unlink()
        config = self.make_sources("newer-cell", (0, 0, 0, 1))
        done = self.run_bake("--out", updated, "--update", killed, *formats, "--json", config=config, levels="0-8")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        self.assertEqual({line["format"] for line in lines if line.get("outcome") == "copied"}, {"terrain"})
        (killed / "terrain/manifest.json").unlink()
        none = self.run_bake("--out", self.place("none"), "--update", killed, *formats, levels="0-8")
        self.assertEqual((none.returncode, "has no manifest.json" in none.stderr), (1, True), none.stderr)

    def test_extensions_of_any_format_are_part_of_the_bake(self):
        place = self.place("formats")
        formats = ("--format", "png,terrain")
        self.assertEqual(self.run_bake("--out", place, *formats, levels="0-2").returncode, 0)
        other = self.run_bake("--out", place, *formats, "--extensions", "none", levels="0-2")
        self.assertEqual(other.returncode, 2, other.stderr)
        self.assertIn('extensions "octvertexnormals", not "none"', other.stderr)

    def test_an_error_that_no_level_has_is_named(self):
        for error, is_unused in (("5", True), ("30", False)):  # the default error of level 11 is 18.8 m
            done = self.run_bake("--dry-run", "--error", error, levels="0-11")
            self.assertEqual((done.returncode, "has no effect" in done.stderr), (0, is_unused), done.stderr)

    def test_options_that_an_archive_alone_does_not_use_are_named(self):
        config = self.scratch / "alone.json"
        config.write_text(json.dumps({"listen": "127.0.0.1:0", "datasets": [
            {"name": "alone", "baked": str(self.reference), "public": True, "attribution": "X", "error_fraction": 0.25}]}))
        process = self.begin([BINARY, "serve", "--config", config])
        self.assertIn("serving", process.stdout.readline())
        process.terminate()
        errors = process.communicate(timeout=60)[1]
        self.assertIn("attribution, error_fraction have no effect; remove them, or add the sources", errors)

    def test_tiles_json_promises_the_tiles_that_are_there(self):
        chunks, folder, single = self.place("chunks"), self.place("folder"), self.place("heights.pmtiles")
        for place, form in ((chunks, "chunks"), (folder, "folder"), (single, "single")):
            done = self.run_bake("--out", place, "--form", form, "--format", "png", "--bbox", "6.2,46.2,6.4,46.4", levels="4-9")
            self.assertEqual(done.returncode, 0, done.stderr)
        documents = [json.loads((folder / "tiles.json").read_text())]
        for of_header, of_document in zip(bounds_of(single), documents[0]["bounds"]):
            self.assertAlmostEqual(of_header, of_document, places=6)
        with self.server(chunks) as get:
            documents.append(json.loads(get("tiles.json", {"Accept-Encoding": "identity"})[1]))
            for document in documents:
                self.assertEqual((document["minzoom"], document["maxzoom"]), (4, 9))
                west, south, east, north = document["bounds"]
                self.assertTrue(5.6 < west <= 6.2 and 6.4 <= east < 7.1 and 45.7 < south <= 46.2 and 46.4 <= north < 46.9, document)
                for x, y in ((west + 1e-6, south + 1e-6), (east - 1e-6, north - 1e-6)):
                    row = (1 - math.asinh(math.tan(math.radians(y))) / math.pi) / 2
                    for level in range(4, 10):
                        tile = f"{level}/{int((x + 180) / 360 * 2 ** level)}/{int(row * 2 ** level)}.png"
                        self.assertEqual((get(tile)[0], (folder / tile).exists()), (200, True), tile)

    def test_height_images_beyond_web_mercator_are_refused(self):
        source = self.scratch / "polar.asc"
        write_asc(source, west=20, south=86, cell=0.05, side=20)
        for form, out in (("chunks", self.place("chunks")), ("single", self.place("polar.pmtiles"))):
            command = [str(part) for part in (BINARY, "bake", source, "--vertical", "ellipsoid", "--format", "png", "--form", form, "--out", out)]
            done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("Web Mercator ends at 85.05 degrees", done.stderr)
            self.assertFalse(out.exists())

    def test_sources_that_change_meanwhile_are_listed(self):
        config = self.make_sources("moving", (0, 0, 0, 0))
        place, fresh = self.place("moving"), self.place("fresh")
        process = self.start("--out", place, "--json", "--threads", 1, config=config)
        process.stdout.readline()
        process.send_signal(signal.SIGSTOP)
        for cell in self.CELLS:
            write_hgt(config.parent / f"{cell}.hgt", 2)
        process.send_signal(signal.SIGCONT)
        _, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 1, errors)
        self.assertIn("of terrain failed", errors)
        self.assertFalse((place / "manifest.json").exists())
        done = self.run_bake("--out", place, config=config)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.run_bake("--out", fresh, config=config).returncode, 0)
        self.expect_equal(place, fresh)

    def test_one_bake_at_a_time(self):
        place = self.place("locked")
        first = self.start("--out", place, "--json", "--threads", 1)
        first.stdout.readline()
        first.send_signal(signal.SIGSTOP)
        second = self.run_bake("--out", place)
        self.assertEqual(second.returncode, 1)
        self.assertIn(f"process {first.pid}", second.stderr)
        part = self.run_bake("--out", place, "--shard", "0/2")
        self.assertEqual((part.returncode, f"process {first.pid}" in part.stderr), (1, True), part.stderr)
        first.kill()
        state = pathlib.Path(f"/proc/{first.pid}/stat")
        while state.read_text().rpartition(")")[2].split()[0] != "Z":  # ended, but nobody has waited for it
            time.sleep(0.01)
        self.assertEqual(self.run_bake("--out", place).returncode, 0)
        first.communicate()
        self.expect_equal(place)

    def test_shards_that_start_together_and_other_divisions(self):
        place = self.place("together")
        shards = [self.start("--out", place, "--shard", f"{i}/8") for i in range(8)]
        for shard in shards:
            shard.communicate()
        self.assertEqual([shard.returncode for shard in shards], [0] * 8)
        place = self.place("divided")
        held = self.start("--out", place, "--json", "--threads", 1, "--shard", "0/2")
        held.stdout.readline()
        held.send_signal(signal.SIGSTOP)
        for other in (("--shard", "0/3"), ("--finish",)):
            done = self.run_bake("--out", place, *other)
            self.assertEqual((done.returncode, f"process {held.pid}" in done.stderr), (1, True), done.stderr)
        held.kill()
        held.communicate()

    def test_what_makes_no_sense_is_refused(self):
        broken = self.scratch / "broken.json"
        broken.write_text('{"listen": 5}')
        for config, said in ((broken, "/listen: must be text"), (self.scratch / "none.json", "cannot be read")):
            done = subprocess.run([BINARY, "bake", "--config", config, "--dry-run"], text=True, capture_output=True)
            self.assertEqual(done.returncode, 2)
            self.assertIn(f"terrace: {config}: {said}", done.stderr)
        other = self.place("other")
        other.mkdir()
        (other / "photo.jpg").write_text("x")
        file = self.scratch / "a-file"
        file.write_text("x")
        empty, link = self.place("empty.pmtiles"), self.place("link")
        empty.mkdir()
        link.symlink_to(empty)
        loop = self.scratch / "loop"
        loop.symlink_to(loop)
        done = self.run_bake("--out", loop)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"{loop}: cannot be created: Too many levels of symbolic links; give a folder", done.stderr)
        shutil.copytree(self.reference, self.place("reference"))
        reference = self.place("reference")
        for arguments, levels, said in (
                (("--out", other), "0-11", "photo.jpg"),
                (("--out", file), "0-11", "is a file"),
                (("--out", reference), "0-10", 'levels "0-11", not "0-10"'),
                (("--out", reference, "--no-gzip"), "0-11", 'gzip "yes", not "no"'),
                (("--out", other, "--finish", "--form", "single"), "0-9", "needs all units in one run"),
                (("--out", reference, "--error", "5"), "0-11", 'error "default", not "5 m"'),
                (("--out", other), "0-30", "from 0 to 24"),
                (("--out", other), "5-3", "--levels 5-3"),
                (("--out", other), "0-20", "has levels 0 to"),
                (("--out", other), "3-9", "--levels 0-9"),
                (("--out", other, "--bbox", "1,2,3"), "0-9", "WEST,SOUTH,EAST,NORTH"),
                (("--out", other, "--bbox", "100,-20,110,-10"), "0-9", "lies outside"),
                (("--out", other, "--form", "tar"), "0-9", "chunks, folder, single or 3tz"),
                (("--out", other, "--form", "single", "--format", "terrain,png"), "0-9", "has one format"),
                (("--out", other, "--format", "obj"), "0-9", "terrain, glb, png"),
                (("--out", other, "--shard", "3/3"), "0-9", "I from 0 to N-1"),
                (("--out", other, "--error", "1", "--fraction", "1"), "0-9", "exclude each other"),
                (("--out", other, "--extensions", "watermask"), "0-9", "no water"),
                (("--out", other, "--update", other), "0-9", "same place"),
                (("--out", "/vsis3/bucket/place", "--form", "single"), "0-9", "a folder of this machine"),
                (("--out", self.place("one.dat"), "--form", "single"), "0-9", "ends with .pmtiles"),
                (("--out", empty, "--form", "single"), "0-9", "is there already"),
                (("--out", link, "--form", "folder"), "0-9", "is there already"),
                ((), "0-9", "--out PLACE"),
        ):
            with self.subTest(arguments=arguments, levels=levels):
                done = self.run_bake(*arguments, levels=levels)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(said, done.stderr)
        self.assertEqual(files_of(other), ["photo.jpg"])
        self.expect_equal(reference)

    def test_billions_of_tiles_need_consent(self):
        place = self.place("many")
        done = subprocess.run([BINARY, "bake", self.scratch / "dems" / "N30E012.hgt", "--finest-error", "0.002", "--out", place],
                              env=self.environment, text=True, stderr=subprocess.PIPE, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\d,\d{3},\d{3},\d{3} tiles would be baked; add --yes")
        self.assertFalse(place.exists())

    def test_a_box_has_its_tiles_and_their_ancestors(self):
        place = self.place("box")
        done = self.run_bake("--out", place, "--bbox", "6.2,46.2,6.4,46.4")
        self.assertEqual(done.returncode, 0, done.stderr)
        manifest, tiles = archive(place)
        _, all_tiles = archive(self.reference)
        self.assertLess(len(tiles), len(all_tiles) // 4)
        for (level, x, y), tile in tiles.items():
            self.assertEqual(tile, all_tiles[level, x, y])
            if level > 0:
                self.assertIn((level - 1, x // 2, y // 2), tiles)
                self.assertIn((level, x ^ 1, y), tiles)
        self.assertIn((11, int(186.3 / 180 * 2048), int(136.3 / 180 * 2048)), tiles)

    def test_a_folder_that_is_named_by_dots_is_refused_before_the_bake(self):
        empty = self.place("dots")
        empty.mkdir()
        for name in (f"{empty}/.", f"{empty}/new/.."):
            done = self.run_bake("--out", name, "--form", "folder", levels="0-2")
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("needs its name; give a new folder", done.stderr)
        self.assertEqual(list(empty.iterdir()), [])

    def test_the_other_forms_hold_the_same_tiles(self):
        _, tiles = archive(self.reference)
        folder, single = self.place("folder"), self.place("single.pmtiles")
        for form, place in (("folder", folder), ("single", single)):
            done = self.run_bake("--out", place, "--form", form)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertFalse(place.with_name(place.name + ".bake").exists())
            self.assertEqual("Content-Encoding: gzip" in done.stderr, form == "folder", done.stderr)
            again = self.run_bake("--out", place, "--form", form)
            self.assertEqual(again.returncode, 2)
            self.assertIn("is there already", again.stderr)
        written = {tuple(int(part) for part in path.relative_to(folder).with_suffix("").parts): path.read_bytes()
                   for path in folder.rglob("*.terrain")}
        self.assertEqual(written, tiles)
        layer = json.loads((folder / "layer.json").read_text())
        promised = {(level, x, y) for level, ranges in enumerate(layer["available"]) for box in ranges
                    for x in range(box["startX"], box["endX"] + 1) for y in range(box["startY"], box["endY"] + 1)}
        self.assertEqual(promised, set(tiles))
        self.assertEqual({(zoom - 1, x, y): tile for (zoom, x, y), tile in tiles_of(single).items()}, tiles)
        plain = self.run_bake("--out", self.place("plain"), "--form", "folder", "--no-gzip", levels="0-3")
        self.assertEqual(plain.returncode, 0, plain.stderr)
        self.assertNotIn("gzip", plain.stderr)

    def test_files_of_others_in_a_folder_named_export_stay(self):
        for form in ("chunks", "folder"):
            place = self.place(form)
            others = (place if form == "chunks" else place.with_name(place.name + ".bake")) / "export/thesis.txt"
            others.parent.mkdir(parents=True)
            others.write_text("x")
            (others.parent / "folder.partial").mkdir()
            done = self.run_bake("--out", place, "--form", form, levels="0-3")
            self.assertEqual(done.returncode, 2 if form == "chunks" else 0, done.stderr)
            self.assertEqual(others.read_text(), "x")
        self.assertEqual([path.name for path in others.parent.parent.rglob("*")], ["export", "thesis.txt"])

    def test_dry_run_counts_the_tiles(self):
        manifest, tiles = archive(self.reference)
        done = self.run_bake("--dry-run", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        estimate = json.loads(done.stdout)
        self.assertEqual(estimate["tiles"], len(tiles))
        self.assertEqual(estimate["files"], len(manifest["units"]))
        written = sum(unit["bytes"] for unit in manifest["units"])
        self.assertTrue(0.5 < estimate["bytes"] / written < 2, (estimate["bytes"], written))

    def test_a_catalogue_is_planned_without_rasters(self):
        catalogue = self.scratch / "cells.txt"
        catalogue.write_text("".join(f"N{south:02}E{west:03}\n" for south in range(60) for west in range(180)))
        done = subprocess.run([BINARY, "bake", "--dry-run", "--json", "--catalogue", catalogue, "--levels", "0-14"],
                              env=self.environment, text=True, stdout=subprocess.PIPE, timeout=60)
        estimate = json.loads(done.stdout)
        expected = 180 * 60 / 180 ** 2 * 4 ** 14  # tiles of level 14 on 180 by 60 degrees
        self.assertAlmostEqual(estimate["levels"][14]["tiles"] / expected, 1, delta=0.01)
        self.assertEqual(estimate["bytes"], 2000 * estimate["tiles"])
        bad = self.scratch / "bad.txt"
        bad.write_text("N46E008\nhello\n")
        done = subprocess.run([BINARY, "bake", "--dry-run", "--catalogue", bad], text=True, stderr=subprocess.PIPE, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn('line 2: "hello"', done.stderr)
        for option in (["--out", self.scratch / "out"], ["--error-fraction", "0.1"], ["--vertical", "egm96"], ["--no-gzip"]):
            done = subprocess.run([BINARY, "bake", "--dry-run", "--catalogue", catalogue, *option], text=True, stdout=subprocess.DEVNULL,
                                  stderr=subprocess.PIPE, timeout=60)
            self.assertEqual(done.returncode, 2, option)
            self.assertIn("no other option", done.stderr)


if __name__ == "__main__":
    unittest.main()
