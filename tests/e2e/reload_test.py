"""Sources and configurations change under the real binary: reload_test.py BINARY SOURCE_DIR.

Two elevation models of one area take turns under one name while clients request tiles. The bytes of every tile of both
are known beforehand, so each reply is recognized as that of one, of the other, or of neither.

TERRACE_LONG_TESTS=1: 200 swaps instead of 30.
"""
import hashlib
import http.client
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
SWAPS = 200 if os.environ.get("TERRACE_LONG_TESTS") else 30
NAME = "N46E007.hgt"
# The manual promises 2 s, but the machine may be busy.
SEEN_WITHIN = 30.0


def replace(path, by):
    """Links `by` under a new name and renames that over `path`."""
    beside = path.with_suffix(".new")
    os.link(by, beside)
    os.rename(beside, path)


class Server:
    def __init__(self, *arguments, meanwhile=lambda server: None):
        """`meanwhile` is called while it starts."""
        self.log_file = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", *map(str, arguments)],
                                        stdout=subprocess.PIPE, stderr=self.log_file, text=True)
        meanwhile(self)
        ready = self.process.stdout.readline()
        match = re.search(r"http://127\.0\.0\.1:(\d+)", ready)
        if not match:
            raise RuntimeError(f"did not start: {ready}{self.log()}")
        self.port = int(match.group(1))
        self.local = threading.local()

    def log(self):
        self.log_file.seek(0)
        return self.log_file.read()

    def get(self, target):
        """(status, headers, body) on the persistent connection of this thread."""
        connection = getattr(self.local, "connection", None)
        if connection is None:
            connection = self.local.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        connection.request("GET", target)
        reply = connection.getresponse()
        body = reply.read()
        return reply.status, reply.headers, body

    def json(self, target):
        status, _, body = self.get(target)
        assert status == 200, (target, status, body)
        return json.loads(body)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(timeout=60)
        self.process.stdout.close()
        self.log_file.close()
        return code


def eventually(condition, seconds=SEEN_WITHIN):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def digest(reply):
    status, headers, body = reply
    assert status == 200, (status, body)
    return headers["ETag"], hashlib.sha256(body).hexdigest()


class Load:
    """Clients that request the targets without a pause; every reply is checked."""

    def __init__(self, server, targets, judge, threads=6):
        self.server, self.targets, self.judge = server, targets, judge
        self.ended, self.replies, self.faults, self.refused_for = threading.Event(), 0, [], 0.0
        self.refused = 0
        self.lock = threading.Lock()
        self.threads = [threading.Thread(target=self.run, args=(i,)) for i in range(threads)]
        for thread in self.threads:
            thread.start()

    def run(self, seed):
        chance = random.Random(seed)
        refused_since = None
        while not self.ended.is_set():
            target = chance.choice(self.targets)
            try:
                reply = self.server.get(target)
                fault = self.judge(target, reply)
            except Exception as error:  # a cut connection is an error
                reply, fault = (0, {}, b""), repr(error)
            now = time.monotonic()
            with self.lock:
                self.replies += 1
                if reply[0] == 503 and not fault:
                    self.refused += 1
                    refused_since = refused_since or now
                    self.refused_for = max(self.refused_for, now - refused_since)
                else:
                    refused_since = None
                if fault and len(self.faults) < 10:
                    self.faults.append((target, reply[0], fault))

    def stop(self):
        self.ended.set()
        for thread in self.threads:
            thread.join()
        return self


class ReloadTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.servers = []

    def tearDown(self):
        for server in self.servers:
            if server.process.poll() is None:
                self.assertEqual(server.stop(), 0)

    def serve(self, *arguments, **more):
        server = Server(*arguments, **more)
        self.servers.append(server)
        return server

    def write_config(self, text, name="terrace.json"):
        """Replaces the file atomically, as good editors do."""
        path = self.folder / name
        beside = path.with_suffix(".tmp")
        beside.write_text(text if isinstance(text, str) else json.dumps(text), encoding="utf-8")
        os.rename(beside, path)
        return path


class Source(ReloadTest):
    @classmethod
    def setUpClass(cls):
        cls.models_folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.models_folder.cleanup)
        folder = pathlib.Path(cls.models_folder.name)
        cls.models, cls.known = [], []
        for i in range(2):
            model = folder / f"{i}.hgt"
            write_hgt(model, i)
            cls.models.append(model)
        layer = None
        for model in cls.models:
            home = folder / f"home-{model.stem}"
            home.mkdir()
            shutil.copy2(model, home / NAME)
            server = Server(home / NAME, "--name", "hills")
            layer = server.json("/hills/layer.json")
            cls.targets = cls.tiles_of(layer)
            cls.known.append({target: digest(server.get(target)) for target in cls.targets})
            server.stop()
        for target in cls.targets:  # otherwise the test could not distinguish them
            assert cls.known[0][target] != cls.known[1][target], target

    @staticmethod
    def tiles_of(layer):
        targets = []
        for level in range(6, len(layer["available"])):
            west, south, east, north = layer["bounds"]
            side = 180 / 2 ** level  # degrees
            middle = (int(((west + east) / 2 + 180) / side), int(((south + north) / 2 + 90) / side))
            for dx in range(2):
                x = min(middle[0] + dx, int((east + 180 - 1e-3) / side))
                for form in ("terrain", "glb"):
                    targets.append(f"/hills/{level}/{x}/{middle[1]}.{form}")
            targets.append(f"/hills/{level}/{middle[0]}/{middle[1]}.terrain?error=2")
        return sorted(set(targets))

    def setUp(self):
        super().setUp()
        home = self.folder / "home"
        home.mkdir()
        self.path = home / NAME
        # Hard links need one file system.
        for i, model in enumerate(self.models):
            shutil.copy2(model, self.folder / f"{i}.hgt")
        self.here = [self.folder / "0.hgt", self.folder / "1.hgt"]
        replace(self.path, self.here[0])

    def judge(self, target, reply):
        status, headers, body = reply
        if status == 503:
            return None if headers["Retry-After"] == "1" else "503 without Retry-After: 1"
        if status != 200:
            return f"status {status}: {body[:200]}"
        found = digest(reply)
        return None if found in (self.known[0][target], self.known[1][target]) else "bytes of neither model"

    def is_all_of(self, server, model):
        return all([self.is_of(server, model, target) for target in self.targets])

    def is_of(self, server, model, target):
        reply = server.get(target)  # on a busy machine 503 for a moment, while the source is being replaced
        return reply[0] == 200 and digest(reply) == self.known[model][target]

    def test_no_answer_mixes_two_models(self):
        server = self.serve(self.path, "--name", "hills", "--log-level", "warn")
        load = Load(server, self.targets, self.judge)
        chance = random.Random(1)
        for swap in range(1, SWAPS + 1):
            replace(self.path, self.here[swap % 2])
            time.sleep(chance.choice((0.02, 0.1, 0.3, 0.5)))
        last = SWAPS % 2
        self.assertTrue(eventually(lambda: self.is_all_of(server, last), 20), server.log()[-2000:])
        load.stop()
        print(f"{SWAPS} swaps: {load.replies} replies, {load.refused} of them 503, at most {load.refused_for:.2f} s long; "
              f"{len(load.faults)} faults", file=sys.stderr)
        self.assertEqual(load.faults, [])
        self.assertGreater(load.replies, SWAPS)
        self.assertLess(load.refused_for, 20)

    def test_no_answer_is_wrong_while_files_are_overwritten_and_deleted(self):
        """Overwrites the bytes of a served file in place, which operators should not do."""
        server = self.serve(self.path, "--name", "hills", "--log-level", "warn")
        load = Load(server, self.targets, self.judge)
        chance, rounds = random.Random(2), 60 if SWAPS > 100 else 8
        contents = [model.read_bytes() for model in self.here]
        for turn in range(1, rounds + 1):
            if turn % 4 == 0:
                self.path.unlink()
                time.sleep(chance.choice((0.1, 0.6)))
                replace(self.path, self.here[turn % 2])
            elif turn % 4 == 1:  # replaces the link by another file before its bytes change
                shutil.copyfile(self.here[turn % 2], self.path.with_suffix(".new"))
                os.rename(self.path.with_suffix(".new"), self.path)
            else:
                with open(self.path, "r+b") as file:
                    file.write(contents[turn % 2])
            time.sleep(chance.choice((0.1, 0.5, 1.0)))
        self.assertTrue(eventually(lambda: self.is_all_of(server, rounds % 2), 20), server.log()[-2000:])
        load.stop()
        print(f"{rounds} times overwritten or deleted: {load.replies} replies, {load.refused} of them 503, at most {load.refused_for:.2f} s long; "
              f"{len(load.faults)} faults {load.faults[:3]}", file=sys.stderr)
        self.assertEqual(load.faults, [])

    def test_a_new_file_is_seen_soon(self):
        server = self.serve(self.path, "--name", "hills")
        slowest = 0
        for turn in range(1, 6):
            beside = self.path.with_suffix(".new")
            shutil.copyfile(self.here[turn % 2], beside)  # has the current time
            os.rename(beside, self.path)
            begun = time.monotonic()
            target = self.targets[turn]
            self.assertTrue(eventually(lambda: self.is_of(server, turn % 2, target)), turn)
            slowest = max(slowest, time.monotonic() - begun)
            self.assertTrue(self.is_all_of(server, turn % 2))
        print(f"seen after {slowest:.2f} s at most", file=sys.stderr)

    def test_what_is_cached_stays_until_the_new_file_is_open(self):
        server = self.serve(self.path, "--name", "hills")
        target = self.targets[0]
        old = digest(server.get(target))
        # No tile can be built, neither of the old nor of another source.
        self.path.unlink()
        self.assertTrue(eventually(lambda: server.get("/readyz")[2].startswith(b"degraded\n")))
        self.assertEqual(server.get("/readyz")[0], 200)
        self.assertIn(b"dataset hills", server.get("/readyz")[2])
        self.assertEqual(digest(server.get(target)), old)
        status, headers, body = server.get(self.targets[-1])
        self.assertEqual((status, headers["Retry-After"]), (503, "1"))
        self.assertNotIn(str(self.folder).encode(), body + server.get("/readyz")[2])
        # If a file cannot be opened, the server keeps the old dataset and tries again.
        self.path.write_bytes(b"not a raster")
        os.utime(self.path, (1, 1))
        time.sleep(1.5)
        self.assertEqual(digest(server.get(target)), old)
        replace(self.path, self.here[1])
        self.assertTrue(eventually(lambda: server.get("/readyz")[2] == b"ready\n"), server.log()[-2000:])
        self.assertTrue(self.is_all_of(server, 1))

    def test_a_file_that_is_written_slowly_is_served_once_it_is_complete(self):
        server = self.serve(self.path, "--name", "hills", "--log-level", "warn")
        load = Load(server, self.targets, self.judge, threads=3)
        content = self.here[1].read_bytes()
        self.path.unlink()
        with open(self.path, "wb") as out:
            for begin in range(0, len(content), len(content) // 8):
                out.write(content[begin:begin + len(content) // 8])
                out.flush()
                time.sleep(0.3)
        self.assertTrue(eventually(lambda: self.is_all_of(server, 1), 20), server.log()[-2000:])
        self.assertEqual(load.stop().faults, [])

    def test_without_watching_a_signal_takes_the_change_over(self):
        server = self.serve(self.path, "--name", "hills", "--watch", "false")
        target, other = self.targets[0], self.targets[-1]
        old = digest(server.get(target))
        replace(self.path, self.here[1])
        time.sleep(1.5)
        self.assertEqual(digest(server.get(target)), old, "from the cache")
        self.assertEqual(server.get(other)[0], 503)
        server.process.send_signal(signal.SIGHUP)
        self.assertTrue(eventually(lambda: self.is_all_of(server, 1)), server.log()[-2000:])


class Configuration(ReloadTest):
    def dataset(self, name, **more):
        return {"name": name, "sources": [str(SOURCE_DIR / "config/samples/jacksboro.tif")], **more}

    def names(self, server):
        return [dataset["name"] for dataset in server.json("/datasets")["datasets"]]

    def test_reloading_under_load_drops_nothing(self):
        config = {"datasets": [self.dataset("a"), self.dataset("b")]}
        server = self.serve("--config", self.write_config(config), "--log-level", "warn")
        targets = Source.tiles_of(server.json("/a/layer.json"))
        targets = [target.replace("/hills/", f"/{name}/") for target in targets for name in ("a", "b")]
        known = {target: digest(server.get(target)) for target in targets}

        def judge(target, reply):
            return None if reply[0] == 200 and digest(reply) == known[target] else f"{reply[0]} {reply[2][:100]}"

        load = Load(server, targets, judge)
        for turn in range(12):
            # Datasets are added and removed before the two requested ones, so that their positions change.
            config["datasets"] = ([self.dataset("new", error_fraction=0.3)] if turn % 2 else []) + \
                [self.dataset("a"), self.dataset("b")][::1 if turn % 3 else -1]
            config["cache_bytes"] = (1 + turn % 4) * 200_000
            self.write_config(config)
            server.process.send_signal(signal.SIGHUP)
            wanted = [dataset["name"] for dataset in config["datasets"]]
            self.assertTrue(eventually(lambda: self.names(server) == wanted), server.log()[-2000:])
        load.stop()
        print(f"12 reloads: {load.replies} replies, {len(load.faults)} faults", file=sys.stderr)
        self.assertEqual(load.faults, [])

    def test_a_wrong_configuration_changes_nothing_and_says_why(self):
        good = {"datasets": [self.dataset("a")]}
        path = self.write_config(good)
        server = self.serve("--config", path)
        self.write_config({"datasets": [self.dataset("b")], "lissten": "x", "io_threads": 0})
        self.assertTrue(eventually(lambda: server.get("/readyz")[2].startswith(b"degraded\n")))
        self.assertEqual(self.names(server), ["a"])
        self.assertEqual(server.get("/a/0/0/0.terrain")[0], 200)
        self.assertIn('/lissten: unknown key; did you mean "listen"?', server.log())
        self.assertIn("/io_threads: must be", server.log())
        # After a signal the server logs it again.
        server.process.send_signal(signal.SIGHUP)
        self.assertTrue(eventually(lambda: server.log().count("/lissten") == 2), server.log())
        self.write_config(good)
        self.assertTrue(eventually(lambda: server.get("/readyz")[2] == b"ready\n"))
        self.assertEqual(self.names(server), ["a"])

    def test_the_file_is_watched_and_datasets_come_and_go(self):
        server = self.serve("--config", self.write_config({"datasets": [self.dataset("a")]}))
        self.write_config({"datasets": [self.dataset("b"), self.dataset("a", attribution="new")], "max_connections": 7,
                           "max_locations": 1})
        self.assertTrue(eventually(lambda: self.names(server) == ["b", "a"]
                                   and server.json("/datasets")["datasets"][1]["attribution"] == "new"), server.log())
        self.assertIn("max_connections has changed; the change takes effect after a restart", server.log())
        self.assertIn("max_locations has changed; the change takes effect after a restart", server.log())
        self.assertEqual(server.get("/a/heights?locations=36.3,-84.2|36.3,-84.1")[0], 200)
        self.write_config({"datasets": [self.dataset("b")]})
        self.assertTrue(eventually(lambda: self.names(server) == ["b"]))
        self.assertEqual(server.get("/a/0/0/0.terrain")[0], 404)

    def test_who_sees_a_dataset_that_comes_back_as_another_is_told(self):
        token = {"name": "team", "token": "0123456789abcdef"}
        public, other = self.dataset("a", public=True), self.dataset("b")
        server = self.serve("--config", self.write_config({"tokens": [token], "datasets": [public, other]}))
        warning = '"public" of dataset a has changed'
        self.write_config({"tokens": [token], "datasets": [other]})
        self.assertTrue(eventually(lambda: server.get("/a/layer.json")[0] == 404), server.log())
        self.assertNotIn(warning, server.log())
        self.write_config({"tokens": [token], "datasets": [other, self.dataset("a")]})
        self.assertTrue(eventually(lambda: server.get("/a/layer.json")[0] == 200), server.log())
        self.assertIn(f"{warning}; restart the server to apply it; until then everybody sees it", server.log())
        self.write_config({"tokens": [token], "datasets": [other, public, self.dataset("c", public=True)]})
        self.assertTrue(eventually(lambda: "until then a token is needed to see it" in server.log()), server.log())
        self.assertEqual(server.log().count(warning), 1)  # unchanged since the start

    def test_a_token_for_a_dataset_that_is_not_there_is_told(self):
        token = {"name": "team", "token": "0123456789abcdef", "datasets": ["b", "jacksboo"]}
        datasets = [self.dataset("b"), self.dataset("jacksboro")]
        server = self.serve("--config", self.write_config({"tokens": [token], "datasets": datasets}))
        self.assertIn('tokens: the token team is for dataset jacksboo, which is not there; did you mean "jacksboro"?', server.log())
        self.assertNotIn("dataset b,", server.log())

    def test_a_glob_finds_what_is_put_into_its_folder(self):
        home = self.folder / "dems"
        home.mkdir()
        samples = SOURCE_DIR / "config/samples"
        shutil.copy2(samples / "jacksboro.tif", home / "one.tif")
        server = self.serve("--config", self.write_config({"datasets": [{"name": "a", "sources": ["dems/*.tif"]}]}))
        before = server.json("/datasets")["datasets"][0]["bounds"]
        shutil.copy2(samples / "etopo5.tif", self.folder / "two")
        (home / "one.tif").unlink()
        os.rename(self.folder / "two", home / "two.tif")
        self.assertTrue(eventually(lambda: server.json("/datasets")["datasets"][0]["bounds"] != before), server.log())

    def test_the_access_log_follows_a_rotation(self):
        log = self.folder / "access.log"
        config = {"datasets": [self.dataset("a")], "access_log": "json", "access_log_file": "access.log"}
        server = self.serve("--config", self.write_config(config))
        server.get("/a/0/0/0.terrain?error=1")
        self.assertTrue(eventually(lambda: log.exists() and log.read_text().count("\n") == 1))
        line = json.loads(log.read_text())
        self.assertEqual((line["target"], line["status"], line["dataset"], line["cache"]),
                         ("/a/0/0/0.terrain?error=1", 200, "a", "miss"))
        os.rename(log, self.folder / "access.log.1")
        server.process.send_signal(signal.SIGHUP)
        self.assertTrue(eventually(log.exists))
        server.get("/a/0/0/0.terrain?error=2")
        self.assertTrue(eventually(lambda: "error=2" in log.read_text()))
        self.assertNotIn("error=2", (self.folder / "access.log.1").read_text())
        self.assertNotIn("error=1", server.log())

    def test_systemd_is_told(self):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(str(self.folder / "notify"))
            manager.settimeout(30)
            os.environ["NOTIFY_SOCKET"] = str(self.folder / "notify")
            try:
                server = self.serve("--config", self.write_config({"datasets": [self.dataset("a")]}))
            finally:
                del os.environ["NOTIFY_SOCKET"]
            self.assertIn("STATUS=listening", manager.recv(4096).decode())
            self.assertRegex(manager.recv(4096).decode(), r"READY=1\nSTATUS=1 dataset at http://127")
            server.process.send_signal(signal.SIGHUP)
            self.assertRegex(manager.recv(4096).decode(), r"^RELOADING=1\nMONOTONIC_USEC=\d+$")
            self.assertIn("READY=1", manager.recv(4096).decode())
            self.assertEqual(server.stop(), 0)
            self.assertIn("STOPPING=1", manager.recv(4096).decode())

    def test_signals_wait_until_it_runs(self):
        (self.folder / NAME).write_bytes(b"\1\0" * 3601 ** 2)  # takes a moment to be read

        def send(server):
            self.assertTrue(eventually(lambda: "dataset d0" in server.log()), server.log())
            for number in (signal.SIGHUP, signal.SIGUSR1):
                server.process.send_signal(number)

        config = {"datasets": [{"name": f"d{i}", "sources": [NAME]} for i in range(8)]}
        server = self.serve("--config", self.write_config(config), meanwhile=send)
        self.assertTrue(eventually(lambda: "the configuration is as it was" in server.log()
                                   and "log level: debug" in server.log()), server.log())

    def test_the_log_level_changes_while_it_runs(self):
        config = {"datasets": [self.dataset("a")], "log_level": "warn"}
        server = self.serve("--config", self.write_config(config))
        server.get("/a/0/0/0.terrain?error=3")
        self.write_config(config | {"log_level": "info"})
        self.assertTrue(eventually(lambda: server.get("/a/0/0/0.terrain?error=4")[0] == 200 and "error=4" in server.log()))
        self.assertNotIn("error=3", server.log())
        server.process.send_signal(signal.SIGUSR1)
        self.assertTrue(eventually(lambda: "log level: debug" in server.log()))
        server.process.send_signal(signal.SIGUSR2)
        self.assertTrue(eventually(lambda: "log level: info" in server.log()))


if __name__ == "__main__":
    unittest.main(verbosity=2, warnings="ignore")  # ignores sockets of finished threads
