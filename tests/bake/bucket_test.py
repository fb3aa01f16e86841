"""`terrace bake` into a bucket, with a store of this folder: bucket_test.py BINARY."""
import json
import re
import shutil
import signal
import subprocess
import time
import unittest
import urllib.request

from bake_case import BINARY, BakeCase, files_of
import in_parallel  # bake_case has set the path
from fake_s3 import FakeS3
from redis_process import Redis

PLACE, BELOW = "/vsis3/terrain/maps/alps", "terrain/maps/alps"
UNIT = "units/7-132-96.pmtiles"


class Bucket(BakeCase):
    CELLS = ("N46E006", "N46E012")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.expected = {name: (cls.reference / name).read_bytes() for name in files_of(cls.reference)}

    @classmethod
    def command(cls, place, *arguments, levels="0-11"):
        return [str(part) for part in (BINARY, "bake", "--config", cls.config, "--levels", levels, "--out", place, "--threads", 1, *arguments)]

    def setUp(self):
        self.store = FakeS3()
        self.addCleanup(self.store.close)

    def start(self, *arguments, place=PLACE, environment=None, before=(), **options):
        return self.begin([*before, *self.command(place, *arguments, **options)], {**self.store.environment(), **(environment or {})})

    def bake(self, *arguments, code=0, **options):
        process = self.start(*arguments, **options)
        out, errors = process.communicate(timeout=150)
        self.assertEqual(process.returncode, code, errors)
        self.assertNotIn("a-secret-key", out + errors)
        return out, errors

    def files(self, place=BELOW):
        return self.store.files(place)

    def expect_all(self, place=BELOW):
        files = self.files(place)
        self.assertEqual(set(files), set(self.expected))
        self.assertEqual([name for name in files if files[name] != self.expected[name]], [])

    def outcomes(self, out):
        return sorted(line["outcome"] for line in map(json.loads, out.splitlines()) if "unit" in line)

    def test_objects_are_the_files_of_a_folder_and_are_served(self):
        self.bake(place=PLACE + "/")
        self.expect_all()
        out, _ = self.bake("--json")
        self.assertEqual(self.outcomes(out), ["kept"] * 9)
        self.expect_all()
        environment = {**self.environment, **self.store.environment()}
        config = self.scratch / "baked.json"
        config.write_text(json.dumps({"listen": "127.0.0.1:0", "allowed_prefixes": ["/vsis3/terrain/"],
                                      "datasets": [{"name": "cells", "baked": PLACE}]}))
        refused = subprocess.run([BINARY, "serve", PLACE, "--allowed-prefixes", "/vsis3/terrain/"], text=True, stderr=subprocess.PIPE,
                                 env=environment)
        self.assertEqual(refused.returncode, 2)
        self.assertIn(f'"baked": "{PLACE}"', refused.stderr)
        server = subprocess.Popen([BINARY, "serve", "--config", config], text=True, env=environment, stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE)
        self.addCleanup(server.communicate)
        self.addCleanup(server.terminate)
        line = server.stdout.readline()
        self.assertIn("serving", line)
        port = re.search(r"127\.0\.0\.1:(\d+)", line)[1]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/cells/layer.json") as reply:
            self.assertEqual(json.load(reply)["available"][0], [{"startX": 0, "startY": 0, "endX": 1, "endY": 0}])
        for key in ("0/1/0", "9/530/388"):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/cells/{key}.terrain") as reply:
                self.assertGreater(len(reply.read()), 88)

    def test_a_place_that_cannot_be_listed_is_refused_and_keeps_what_it_holds(self):
        self.store.objects[f"{BELOW}/planet.pmtiles"] = b"of somebody else"
        for status in (403, 500):
            self.store.refuse = lambda method, key, query, status=status: status if method == "GET" and key.strip("/") == "terrain" else None
            _, errors = self.bake(code=1)
            self.assertIn("check the right to list the bucket", errors)
        self.store.refuse = lambda method, key, query: None
        _, errors = self.bake(code=2)
        self.assertIn("holds something that is no bake (planet.pmtiles)", errors)
        self.assertEqual(self.files(), {"planet.pmtiles": b"of somebody else"})

    def test_a_failed_upload_leaves_the_object_that_was_there(self):
        of_another = self.expected[UNIT]

        def refuse(method, key, query):  # another worker's unit appears while this one's is being put
            if query.get("partNumber") != "2" or not key.endswith(UNIT):
                return None
            self.store.objects[f"{BELOW}/{UNIT}"] = of_another
            return 403
        self.store.refuse = refuse
        self.bake(environment={"VSIS3_CHUNK_SIZE_BYTES": "50000"})  # tried again, it is found
        self.assertEqual(self.files().get(UNIT), of_another)

    def test_of_two_other_bakes_that_begin_together_one_is_refused(self):
        processes = [self.start(), self.start("--error", "60")]
        ends = [(process.communicate(timeout=150)[1], process.returncode) for process in processes]
        self.assertEqual(sorted(code == 0 for _, code in ends), [False, True], ends)

    def test_killed_at_any_moment_it_goes_on_to_the_same_objects(self):
        for after in (1, 2, 3, 3, 3):  # writes: the lock, the identity, the units
            writes = sum(method == "PUT" for method, _, _ in self.store.requests) + after
            process = self.start()
            until = time.monotonic() + 60
            while sum(method == "PUT" for method, _, _ in self.store.requests) < writes and process.poll() is None:
                self.assertLess(time.monotonic(), until)
                time.sleep(0.002)
            process.kill()
            process.communicate()
            self.assertNotIn("manifest.json", set(self.files()))
            for name, data in self.files().items():
                self.assertTrue(data == self.expected.get(name, data), name)
        process = self.start("--json")
        process.stdout.readline()
        process.send_signal(signal.SIGTERM)
        process.communicate()
        self.assertEqual(process.returncode, 143)
        self.assertNotIn("bake.lock", set(self.files()))
        self.bake()
        self.expect_all()

    def test_a_store_that_refuses_a_unit(self):
        self.store.refuse = lambda method, key, query: 403 if method == "PUT" and key.endswith(UNIT) else None
        out, errors = self.bake(code=1)
        self.assertIn("unit 7-132-96 of terrain failed: /vsis3/terrain/maps/alps/units/7-132-96.pmtiles cannot be written", errors)
        self.assertIn("check the bucket, the credentials and their right to write", errors)
        self.assertEqual(set(self.files()), set(self.expected) - {UNIT, "manifest.json"})
        refused = []

        def refuse_now_and_then(method, key, query):
            if method != "PUT" or len(refused) % 3 == 2:
                refused.append(None) if method == "PUT" else None
                return None
            refused.append(key)
            return 503
        self.store.refuse = refuse_now_and_then
        out, _ = self.bake("--json")
        self.assertEqual(self.outcomes(out), ["baked"] + ["kept"] * 8)
        self.assertGreater(len(refused), 3)
        self.expect_all()

    def test_a_store_that_refuses_a_part(self):
        small = {"VSIS3_CHUNK_SIZE_BYTES": "50000"}  # several parts
        self.store.refuse = lambda method, key, query: 403 if query.get("partNumber") == "2" and key.endswith(UNIT) else None
        _, errors = self.bake(code=1, environment=small)
        self.assertIn("unit 7-132-96 of terrain failed", errors)
        self.assertEqual(self.store.uploads, {}, "what was begun is cancelled")
        self.assertNotIn(UNIT, set(self.files()))
        self.store.refuse = lambda method, key, query: None
        self.bake(environment=small)
        self.assertTrue(any(query.get("partNumber") == "2" for _, _, query in self.store.requests))
        self.expect_all()

    def test_a_store_that_cannot_be_used(self):
        self.store.refuse = lambda method, key, query: 403
        _, errors = self.bake(code=1)
        self.assertIn("bake.lock", errors)
        self.assertIn("AccessDenied", errors)
        self.store.close()
        _, errors = self.bake(code=1)
        self.assertIn("/vsis3/terrain/maps/alps/bake.lock cannot be looked up now", errors)
        self.assertIn("check the endpoint, the credentials and their right to read", errors)
        self.store = FakeS3()
        self.addCleanup(self.store.close)
        nowhere = self.scratch / "full"
        nowhere.mkdir()
        _, errors = self.bake(code=1, environment={"TMPDIR": str(nowhere)}, before=("prlimit", "--fsize=1000", "--"))
        self.assertIn(f"{nowhere} cannot be written", errors)
        self.assertNotIn("manifest.json", set(self.files()))

    def test_what_cannot_be_read_is_not_taken_for_absent(self):
        self.bake()
        for name in ("manifest.json", "bake.json"):
            for methods in (("GET", "HEAD"), ("GET",)):
                self.store.refuse = lambda method, key, query, of=(name, methods): 403 if method in of[1] and key == f"{BELOW}/{of[0]}" else None
                first = len(self.store.requests)
                _, errors = self.bake(code=1)
                self.assertRegex(errors, rf"{PLACE}/{name} cannot be (looked up|opened|read) now")
                self.assertIn("AccessDenied", errors)
                self.assertNotIn("remove", errors)
                put = {key for method, key, _ in self.store.requests[first:] if method == "PUT"}
                self.assertEqual(put, {f"{BELOW}/bake.lock"})
        self.store.refuse = lambda method, key, query: None
        self.expect_all()

    def test_a_lock_that_cannot_be_read_names_no_process(self):
        lock = f"{BELOW}/bake.lock"
        self.store.refuse = lambda method, key, query: 403 if method in ("GET", "HEAD") and key == lock and lock in self.store.objects else None
        _, errors = self.bake(code=1)
        self.assertRegex(errors, rf"{PLACE}/bake.lock cannot be (looked up|opened|read) now")
        self.assertNotIn("process", errors)
        self.store.refuse = lambda method, key, query: None
        self.bake()  # the lock that stayed is of a process that has ended
        self.expect_all()

    def test_places_that_hold_something_else(self):
        self.store.objects[BELOW + "/photo.jpg"] = b"x"
        _, errors = self.bake(code=2)
        self.assertIn("holds something that is no bake (photo.jpg)", errors)
        self.assertEqual(set(self.files()), {"photo.jpg"})
        del self.store.objects[BELOW + "/photo.jpg"]
        self.store.objects[BELOW + "-2/photo.jpg"] = b"x"  # another place
        self.bake()
        _, errors = self.bake("--error", "5", code=2)
        self.assertIn('error "default", not "5 m"', errors)
        self.store.objects[BELOW + "/bake.lock"] = b"another-host 1 2 boot space\n"
        _, errors = self.bake(code=1)
        self.assertIn("process 1 on host another-host is baking there", errors)
        self.assertIn("remove /vsis3/terrain/maps/alps/bake.lock", errors)
        del self.store.objects[BELOW + "/bake.lock"]
        self.expect_all()

    def test_damaged_objects_are_baked_again(self):
        self.bake()
        changed = bytearray(self.expected[UNIT])
        changed[len(changed) // 2] ^= 1
        self.store.objects[f"{BELOW}/{UNIT}"] = bytes(changed)
        self.store.objects[BELOW + "/top.pmtiles"] = self.expected["top.pmtiles"][:-1]
        _, errors = self.bake("--finish", code=1)
        self.assertIn("unit 7-132-96 of terrain cannot be used", errors)
        out, _ = self.bake("--json")
        self.assertEqual(self.outcomes(out), ["baked"] * 2 + ["kept"] * 7)
        self.expect_all()

    def test_shards_updates_and_two_formats(self):
        for index in (0, 1):
            self.bake("--shard", f"{index}/2")
        self.assertNotIn("manifest.json", set(self.files()))
        self.bake("--finish")
        self.expect_all()
        out, _ = self.bake("--json", "--update", PLACE, place=PLACE + "-new")
        self.assertEqual(self.outcomes(out), ["copied"] * 9)
        self.expect_all(BELOW + "-new")
        self.bake("--format", "terrain,png", place=PLACE + "-both", levels="0-8")
        self.assertIn("png/manifest.json", self.files(BELOW + "-both"))

    @unittest.skipUnless(shutil.which("redis-server"), "redis-server is not installed")
    def test_workers_of_a_queue(self):
        redis = Redis(self.scratch / "redis")
        self.addCleanup(redis.kill)
        workers = [self.start("--queue", redis.url, "--job", "bucket", "--json") for _ in range(3)]
        outs = []
        for worker in workers:
            out, errors = worker.communicate(timeout=150)
            self.assertEqual(worker.returncode, 0, errors)
            outs.append(out)
        self.expect_all()

    def test_arguments(self):
        for arguments, place, part in ((("--form", "single"), PLACE, "--form single is written into a folder of this machine"),
                                       ((), "/vsicurl/http://127.0.0.1/x", "or into a bucket such as /vsis3/BUCKET/FOLDER"),
                                       ((), "s3://terrain/alps", "name a bucket as /vsis3/BUCKET/FOLDER, here /vsis3/terrain/alps"),
                                       ((), "https://example.org/alps", "URLs are not accepted"),
                                       (("--update", PLACE + "/"), PLACE, "name the same place")):
            _, errors = self.bake(*arguments, place=place, code=2)
            self.assertIn(part, errors)
        done = subprocess.run([BINARY, "bake", "--config", self.config, "--into-cache", "/vsis3/terrain/cache"], text=True, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, 2)
        self.assertIn("a folder of this machine", done.stderr)


if __name__ == "__main__":
    in_parallel.main()
