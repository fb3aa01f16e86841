"""terrace bake --into-cache, as a user runs it: seed_cache_test.py BINARY."""
import collections
import http.client
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "e2e"))
from srtm import write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
LEVELS = 9
ACCEPT = {"Accept": "application/vnd.quantized-mesh;extensions=octvertexnormals"}


class SeedCache(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        write_hgt(cls.scratch / "N46E007.hgt")
        # Keys of tiles that an edit touches differ from those of the others.
        ring = [[7.4, 46.4], [7.5, 46.4], [7.5, 46.5], [7.4, 46.5], [7.4, 46.4]]
        feature = {"type": "Feature", "properties": {"terrain": {"op": "offset", "metres": 100}},
                   "geometry": {"type": "Polygon", "coordinates": [ring]}}
        (cls.scratch / "edits.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))

    def config(self, name, **disk_cache):
        """A configuration with a disk cache in the folder `name`, and that folder."""
        cache = self.scratch / self.id().rpartition(".")[2] / name
        path = cache.with_suffix(".json")
        path.parent.mkdir(exist_ok=True)
        dataset = {"name": "cell", "sources": [str(self.scratch / "N46E007.hgt")], "vertical": "ellipsoid",
                   "edits": [str(self.scratch / "edits.geojson")]}
        config = {"datasets": [dataset], "cache_dir": str(self.scratch / "statistics")}
        if disk_cache is not None:
            config["disk_cache"] = {"directory": str(cache), **disk_cache}
        path.write_text(json.dumps(config))
        return path, cache

    def command(self, config, cache, *arguments, levels=LEVELS):
        return [str(part) for part in (BINARY, "bake", "--config", config, "--into-cache", cache, "--levels", f"0-{levels}",
                                       "--format", "terrain,glb,png", *arguments)]

    def seed(self, config, cache, *arguments, levels=LEVELS):
        return subprocess.run(self.command(config, cache, "--json", *arguments, levels=levels), capture_output=True, text=True, timeout=300)

    def crawl(self, config, *flags):
        """{(path, coding): (tier, body)} of every tile that was seeded, and what the server built."""
        process = subprocess.Popen([BINARY, "serve", "--config", config, "--listen", "127.0.0.1:0", "--cache-bytes", "0", *flags],
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            port = int(re.search(r"127\.0\.0\.1:(\d+)", process.stdout.readline())[1])
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)

            def get(path, **headers):
                connection.request("GET", path, headers=headers)
                reply = connection.getresponse()
                return reply.status, reply.headers, reply.read()
            replies = {}
            layer = json.loads(get("/cell/layer.json")[2])
            for level, ranges in enumerate(layer["available"][:LEVELS + 1]):
                for box in ranges:
                    for x in range(box["startX"], box["endX"] + 1):
                        for y in range(box["startY"], box["endY"] + 1):
                            for suffix, codings in (("terrain", ("gzip", "br")), ("glb", ("gzip",))):
                                for coding in codings:
                                    path = f"/cell/{level}/{x}/{y}.{suffix}"
                                    status, headers, body = get(path, **ACCEPT, **{"Accept-Encoding": coding})
                                    self.assertEqual(status, 200, path)
                                    replies[path, coding] = re.match(r"cache;desc=(\w+)", headers["Server-Timing"])[1], body
            for level in range(LEVELS + 1):
                x, y = 532 * 2 ** level // 1024, 363 * 2 ** level // 1024  # over the data
                status, headers, body = get(f"/cell/{level}/{x}/{y}.png")
                self.assertEqual(status, 200, (level, x, y))
                replies[level, x, y] = re.match(r"cache;desc=(\w+)", headers["Server-Timing"])[1], body
            metrics = get("/metrics", **{"Accept-Encoding": "identity"})[2].decode()
            connection.close()
            return replies, sum(float(count) for count in re.findall(r"^terrace_tile_builds_total\S* (\S+)$", metrics, re.M))
        finally:
            process.kill()
            process.communicate()

    def test_a_server_then_builds_nothing(self):
        config, cache = self.config("cache")
        seeded = self.seed(config, cache)
        self.assertEqual(seeded.returncode, 0, seeded.stderr)
        summary = json.loads(seeded.stdout.splitlines()[-1])
        self.assertEqual(summary["built_tiles"], summary["tiles"])
        self.assertGreater(summary["tiles"], 200)
        found, built = self.crawl(config)
        self.assertEqual(collections.Counter(tier for tier, _ in found.values()), {"disk": len(found)})
        self.assertEqual(built, 0)
        empty, _ = self.config("empty")
        fresh, built = self.crawl(empty)
        self.assertEqual(built, len(fresh))
        self.assertEqual({key: body for key, (_, body) in found.items()}, {key: body for key, (_, body) in fresh.items()})
        again = self.seed(config, cache)
        self.assertEqual((again.returncode, json.loads(again.stdout.splitlines()[-1])["built_tiles"]), (0, 0), again.stderr)

    def test_a_killed_seeding_goes_on(self):
        config, cache = self.config("cache")
        process = subprocess.Popen(self.command(config, cache, "--threads", "1"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 60
        # Records are appended to the write-ahead log one by one; all of them have about 840,000 bytes.
        while sum(file.stat().st_size for file in cache.rglob("*.log")) < 100_000 and time.monotonic() < deadline:
            self.assertIsNone(process.poll(), "the seeding ended before it was killed")
            time.sleep(0.001)
        process.kill()
        process.communicate()
        seeded = self.seed(config, cache)
        self.assertEqual(seeded.returncode, 0, seeded.stderr)
        summary = json.loads(seeded.stdout.splitlines()[-1])
        self.assertGreater(summary["kept_tiles"], 0)
        self.assertGreater(summary["built_tiles"], 0)
        self.assertEqual(summary["kept_tiles"] + summary["built_tiles"], summary["tiles"])
        found, built = self.crawl(config)
        self.assertEqual((built, {tier for tier, _ in found.values()}), (0, {"disk"}))

    def test_a_folder_of_any_name(self):
        config, cache = self.config('a "cache" \\ of tiles')
        seeded = self.seed(config, cache, levels=1)
        self.assertEqual(seeded.returncode, 0, seeded.stderr)
        self.assertEqual(json.loads(seeded.stdout.splitlines()[-1])["cache"], str(cache))

    def test_one_coding(self):
        config, cache = self.config("cache")
        self.assertEqual(self.seed(config, cache, "--codings", "br").returncode, 0)
        found, _ = self.crawl(config)
        tiers = {coding: {found[key][0] for key in found if key[-1] == coding and ".terrain" in str(key[0])} for coding in ("br", "gzip")}
        self.assertEqual(tiers, {"br": {"disk"}, "gzip": {"miss"}})

    def test_refusals(self):
        config, cache = self.config("cache", tile_bytes=16 << 20)
        noise = self.scratch / "N10E010.hgt"  # of which tiles are large
        noise.write_bytes(bytes(byte & 7 if i % 2 == 0 else byte for i, byte in enumerate(random.Random(28).randbytes(2 * 1201 * 1201))))
        changed = json.loads(config.read_text().replace("N46E007", noise.stem))
        del changed["datasets"][0]["edits"]  # they are elsewhere
        config.write_text(json.dumps(changed))
        full = self.seed(config, cache, "--error", "1", levels=10)
        self.assertEqual(full.returncode, 1, full.stderr)
        self.assertIn("raise disk_cache.tile_bytes", full.stderr)
        # The remedy keeps what is there: a full cache has lost nothing.
        built = int(re.search(r"is full after ([\d,]+) of", full.stderr)[1].replace(",", ""))
        changed["disk_cache"]["tile_bytes"] = 256 << 20
        config.write_text(json.dumps(changed))
        larger = self.seed(config, cache, "--error", "1", levels=10)
        self.assertEqual((larger.returncode, json.loads(larger.stdout.splitlines()[-1])["kept_tiles"]), (0, built), larger.stderr)
        config, cache = self.config("large", tile_bytes=0)
        self.assertIn("tile_bytes is 0", self.seed(config, cache).stderr)
        config, cache = self.config("used")
        server = subprocess.Popen([BINARY, "serve", "--config", config, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True)
        try:
            server.stdout.readline()
            used = self.seed(config, cache)
            self.assertEqual(used.returncode, 2)
            self.assertIn("a server must not run meanwhile", used.stderr)
        finally:
            server.kill()
            server.communicate()
        for wrong, part in ((("--out", cache), "leave out --out"), (("--codings", "deflate"), "must be gzip, br, zstd"),
                            (("--codings", "br,br"), "has br twice")):
            refused = self.seed(config, cache, *wrong)
            self.assertEqual(refused.returncode, 2, refused.stderr)
            self.assertIn(part, refused.stderr)


if __name__ == "__main__":
    unittest.main()
