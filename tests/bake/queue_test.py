"""Many bakers and one queue, with a real redis-server: queue_test.py BINARY [--long]. --long: 200 kills instead of 8."""
import contextlib
import filecmp
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "e2e"))
from redis_process import Listener, Redis, proxy  # noqa: E402
from srtm import write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
KILLS = 200 if "--long" in sys.argv else 8
sys.argv = [argument for argument in sys.argv if argument != "--long"]
CELLS = ("N46E006", "N46E007", "N46E012", "N30E012")
LEASE = 1.5  # seconds; the heartbeat is a third


def files_of(place):
    return sorted(path.relative_to(place).as_posix() for path in pathlib.Path(place).rglob("*") if path.is_file())


@unittest.skipUnless(shutil.which("redis-server"), "redis-server is not installed")
class Queue(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        cls.environment = {**os.environ, "XDG_CACHE_HOME": str(cls.scratch / "cache")}
        cls.environment.pop("TERRACE_QUEUE_PASSWORD", None)
        cls.config = cls.make_sources("dems")
        cls.reference = cls.scratch / "reference"
        begun = time.monotonic()
        done = subprocess.run([BINARY, "bake", "--config", cls.config, "--levels", "0-11", "--out", cls.reference, "--threads", "1"],
                              env=cls.environment, text=True, stderr=subprocess.PIPE)
        assert done.returncode == 0, done.stderr
        cls.seconds = time.monotonic() - begun
        cls.units = [unit["name"] for unit in json.loads((cls.reference / "manifest.json").read_text())["units"]]

    @classmethod
    def make_sources(cls, folder):
        (cls.scratch / folder).mkdir()
        for cell in CELLS:
            write_hgt(cls.scratch / folder / f"{cell}.hgt")
        config = cls.scratch / folder / "terrace.json"
        config.write_text(json.dumps({"datasets": [{"name": "cells", "sources": ["*.hgt"], "floor": 0, "vertical": "ellipsoid"}]}))
        return config

    def setUp(self):
        self.redis = self.start_redis("redis")
        self.job = "test-job"

    def start_redis(self, name, *options):
        redis = Redis(self.scratch / f"{self.id().rpartition('.')[2]}-{name}", *options)
        self.addCleanup(redis.kill)
        return redis

    def place(self, name="out"):
        place = self.scratch / f"{self.id().rpartition('.')[2]}-{name}"
        self.addCleanup(shutil.rmtree, place, ignore_errors=True)
        return place

    def command(self, place, *arguments, url=None, config=None, levels="0-11", lease=LEASE):
        return [str(part) for part in (
            BINARY, "bake", "--config", config or self.config, "--levels", levels, "--out", place, "--queue", url or self.redis.url,
            "--job", self.job, "--lease", lease, "--json", "--threads", 1, *arguments)]

    def start(self, place, *arguments, before=(), environment=None, limit=None, **options):
        process = subprocess.Popen(
            [*before, *self.command(place, *arguments, **options)], env={**self.environment, **(environment or {})}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))))

        def end():
            if process.poll() is None:
                process.kill()
            process.communicate()
        self.addCleanup(end)
        return process

    def joined(self, place, count, **options):
        """Workers that have all joined the job, each with a unit or about to take one."""
        workers = []
        for _ in range(count):
            worker = self.start(place, lease=20, **options)
            workers.append(worker)
            until = time.monotonic() + 60
            while f"-{worker.pid}-" not in str(self.redis("XINFO", "CONSUMERS", self.key("units"), "bakers")):
                self.assertLess(time.monotonic(), until)
                time.sleep(0.005)
            worker.send_signal(signal.SIGSTOP)
        for worker in workers:
            worker.send_signal(signal.SIGCONT)
        return workers

    def end(self, process, code=0):
        out, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, code, errors)
        return out, errors

    def run_bake(self, place, *arguments, code=0, **options):
        return self.end(self.start(place, *arguments, **options), code)

    def status(self, *arguments, code=0):
        done = subprocess.run([BINARY, "bake", "status", "--queue", self.redis.url, "--job", self.job, *arguments], text=True,
                              env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stdout

    def key(self, what):
        return f"terrace:{{{self.job}}}:{what}"

    def expect_equal(self, place, reference=None):
        reference = reference or self.reference
        names = files_of(reference)
        self.assertEqual(files_of(place), names)
        _, different, unreadable = filecmp.cmpfiles(reference, place, names, shallow=False)
        self.assertEqual((different, unreadable), ([], []))

    def baked(self, *outputs, outcomes=("baked",)):
        """The units of the lines of --json, sorted, each as often as it was baked."""
        lines = [json.loads(line) for output in outputs for line in output.splitlines()]
        return sorted(line["unit"] for line in lines if "unit" in line and line["outcome"] in outcomes)

    def test_workers_share_the_units(self):
        place = self.place()
        workers = [self.start(place) for _ in range(4)]
        outputs = [self.end(worker)[0] for worker in workers]
        self.expect_equal(place)
        self.assertEqual(self.baked(*outputs), sorted(self.units), "each unit once")
        self.assertEqual(json.loads(self.status("--json"))["state"], "finished")
        again, errors = self.run_bake(place)
        self.assertIn("is complete already", errors)
        self.expect_equal(place)
        self.assertGreater(self.redis("TTL", self.key("job")), 0)

    def test_killed_workers_leave_the_same_files(self):
        place, dice, ended, lives = self.place(), random.Random(11), 0, 0
        workers = []
        for kill in range(KILLS):
            while len(workers) < 4:
                workers.append(self.start(place))
            time.sleep(dice.uniform(0, self.seconds / 4))
            victim = workers.pop(dice.randrange(len(workers)))
            victim.kill()
            victim.communicate()
            for worker in [worker for worker in workers if worker.poll() is not None]:
                workers.remove(worker)
                _, errors = worker.communicate()
                # A unit whose workers were killed three times ends the job; whoever comes next tries it again.
                self.assertIn(worker.returncode, (0, 1), errors)
                self.assertTrue(worker.returncode == 0 or "is incomplete" in errors, errors)
                ended += 1
            if (place / "manifest.json").exists():
                for worker in workers:
                    worker.communicate()
                workers.clear()
                self.finish(place)
                lives += 1
                self.status("--remove")
                shutil.rmtree(place)
        for worker in workers:
            worker.communicate()
        self.finish(place)
        print(f"{KILLS} kills, {lives + 1} archives", file=sys.stderr)

    def finish(self, place):
        """Runs two workers to the end. A worker that was killed between manifest and good-bye leaves its traces to them."""
        for worker in [self.start(place) for _ in range(2)]:
            worker.communicate()
        self.run_bake(place)
        left = [name for name in files_of(place) if name.endswith((".lock", ".partial"))]
        for name in left:  # of a worker that was killed after the manifest was written
            (place / name).unlink()
        self.expect_equal(place)

    def test_a_stopped_worker_loses_its_unit_and_comes_back(self):
        place = self.place()
        first = self.start(place)
        first.stdout.readline()
        while True:  # until it is stopped in the middle of a unit
            first.send_signal(signal.SIGSTOP)
            held = json.loads(self.status("--json"))["running"]
            unit = held[0]["unit"].split("/")[1] if held else ""
            if unit and not (place / "units" / f"{unit}.pmtiles").exists():
                break
            first.send_signal(signal.SIGCONT)
            time.sleep(0.02)
        out, _ = self.run_bake(place)  # waits for the lease, inherits, finishes
        self.assertIn(unit, self.baked(out))
        self.expect_equal(place)
        first.send_signal(signal.SIGCONT)
        self.end(first)
        self.expect_equal(place)

    def test_a_slow_unit_is_not_inherited_while_its_worker_lives(self):
        place = self.place()
        lease = self.seconds / len(self.units) / 2
        workers = [self.start(place, lease=round(lease, 3)) for _ in range(3)]
        outputs = [self.end(worker)[0] for worker in workers]
        self.assertEqual(self.baked(*outputs), sorted(self.units), f"a lease of {lease:.3f} s is shorter than a unit")
        self.expect_equal(place)

    def test_a_worker_that_is_asked_to_stop_gives_its_unit_back(self):
        place = self.place()
        first = self.start(place, lease=600)
        line = first.stdout.readline()
        first.send_signal(signal.SIGTERM)
        rest, errors = self.end(first, 143)
        self.assertIn("run the same command again", errors)
        self.assertEqual([name for name in files_of(place) if name.endswith((".partial", ".lock"))], [])
        self.assertEqual(json.loads(self.status("--json"))["running"], [])
        out, _ = self.run_bake(place, lease=600)  # the test would wait ten minutes for the lease
        self.assertEqual(self.baked(line, rest, out), sorted(self.units))
        self.expect_equal(place)

    def test_redis_that_is_killed_comes_back_from_its_aof(self):
        self.redis = self.start_redis("aof", "--appendonly", "yes", "--appendfsync", "always")
        place = self.place()
        workers = self.joined(place, 3)
        line = workers[0].stdout.readline()
        self.redis.kill()
        time.sleep(self.seconds / 4)
        self.redis.start()
        self.assertEqual(self.redis("EXISTS", self.key("units")), 1, "the AOF was read")
        ends = [self.end(worker) for worker in workers]
        self.assertTrue(any("is back" in errors for _, errors in ends), ends)
        self.expect_equal(place)
        self.assertEqual(sorted(set(self.baked(line, *(out for out, _ in ends)))), sorted(self.units))

    def test_a_lost_redis_is_filled_with_what_is_missing(self):
        place = self.place()
        workers = self.joined(place, 3)
        line = workers[0].stdout.readline()
        self.redis.lose()
        time.sleep(self.seconds / 4)
        for worker in workers:
            worker.send_signal(signal.SIGSTOP)
        self.redis.start()
        there = {file.stem for file in place.rglob("*.pmtiles")}
        missing = set(self.units) - there
        if missing:  # else the workers were quick
            workers[1].send_signal(signal.SIGCONT)
            until = time.monotonic() + 60
            while not self.redis("EXISTS", self.key("units")):
                self.assertLess(time.monotonic(), until)
                time.sleep(0.02)
            workers[1].send_signal(signal.SIGSTOP)
            queued = {entry[1][1].split("/")[1] for entry in self.redis("XRANGE", self.key("units"), "-", "+")}
            self.assertLessEqual(queued, missing)
        for worker in workers:
            worker.send_signal(signal.SIGCONT)
        ends = [self.end(worker) for worker in workers]
        self.expect_equal(place)
        self.assertEqual(sorted(set(self.baked(line, *(out for out, _ in ends)))), sorted(self.units))

    def test_an_emptied_redis_is_filled_again(self):
        for command in (("FLUSHALL",), ("DEL", self.key("units")), ("XGROUP", "DESTROY", self.key("units"), "bakers")):
            place = self.place(command[0])
            workers = self.joined(place, 2)
            workers[0].stdout.readline()
            self.redis(*command)
            for worker in workers:
                self.end(worker)
            self.expect_equal(place)

    def test_units_that_cannot_be_baked_are_listed(self):
        config = self.make_sources("poisoned")
        place = self.place()
        workers = self.joined(place, 2, config=config)
        lines = [worker.stdout.readline() for worker in workers]
        for worker in workers:
            worker.send_signal(signal.SIGSTOP)
        os.truncate(config.parent / "N30E012.hgt", 100_000)
        for worker in workers:
            worker.send_signal(signal.SIGCONT)
        ends = [self.end(worker, 1) for worker in workers]
        status = json.loads(self.status("--json", code=1))
        self.assertEqual(status["state"], "incomplete")
        dead = {unit["unit"].split("/")[1]: unit for unit in status["dead"]}
        self.assertEqual({unit["deliveries"] for unit in dead.values()}, {3})
        for unit in set(dead) - {"top"}:
            south = int(unit.split("-")[2]) * 180 / 128 - 90
            self.assertTrue(27 < south < 32, unit)  # around N30E012; the other cells lie 15 degrees to the north
        self.assertEqual(sorted([*dead, *self.baked(*lines, *(out for out, _ in ends))]), sorted(self.units), "all others are done")
        for _, errors in ends:
            for unit in dead:
                self.assertIn(f"unit terrain/{unit} failed: ", errors)
            self.assertIn(f"is incomplete: {len(dead)} of {len(self.units)} units failed", errors)
        self.assertFalse((place / "manifest.json").exists())
        self.assertIn("dead: terrain/", self.status(code=1))
        write_hgt(config.parent / "N30E012.hgt")
        out, _ = self.run_bake(place, config=config)
        self.assertEqual(self.baked(out), sorted(dead))
        self.expect_equal(place)

    def test_a_unit_that_kills_its_workers_is_given_up(self):
        place = self.place()
        begun = self.start(place)
        begun.stdout.readline()
        begun.kill()
        begun.communicate()
        pending = self.redis("XPENDING", self.key("units"), "bakers", "-", "+", 1)[0]
        unit = self.redis("XRANGE", self.key("units"), pending[0], pending[0])[0][1][1]
        self.redis("XCLAIM", self.key("units"), "bakers", "killed", 0, pending[0], "RETRYCOUNT", 3)
        out, errors = self.run_bake(place, code=1)
        self.assertIn(f"unit {unit} failed: its workers ended before it was done", errors)
        self.run_bake(place)
        self.expect_equal(place)

    def test_damaged_files_are_found_at_the_end(self):
        place = self.place()
        worker = self.start(place)
        unit = json.loads(worker.stdout.readline())["unit"]
        worker.send_signal(signal.SIGSTOP)
        file = place / "units" / f"{unit}.pmtiles"
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
        worker.send_signal(signal.SIGCONT)
        out, errors = self.end(worker)
        self.assertIn("1 units were done but are not there, or are damaged", errors)
        self.assertIn(unit, self.baked(out))
        self.expect_equal(place)

    def test_formats_together(self):
        reference, place = self.place("reference"), self.place()
        formats = ("--format", "terrain,glb,png")
        done = subprocess.run([BINARY, "bake", "--config", self.config, "--levels", "0-8", "--out", reference, *formats],
                              env=self.environment, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        for worker in [self.start(place, *formats, levels="0-8") for _ in range(2)]:
            self.end(worker)
        self.expect_equal(place, reference)

    def test_clocks_do_not_matter(self):
        place = self.place()
        wrong = {"FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        ahead = self.start(place, before=("faketime", "-f", "+1h"), environment=wrong)
        behind = self.start(place, before=("faketime", "-f", "-1h"), environment=wrong)
        right = self.start(place)
        outputs = [self.end(worker)[0] for worker in (ahead, behind, right)]
        self.assertEqual(self.baked(*outputs), sorted(self.units), "no unit was inherited")
        self.expect_equal(place)

    def test_another_bake_of_the_same_name_is_refused(self):
        place, other = self.place(), self.place("other")
        worker = self.start(place)
        worker.stdout.readline()
        worker.send_signal(signal.SIGSTOP)
        _, errors = self.run_bake(other, "--extensions", "none", code=2, levels="0-10")
        self.assertIn('levels "0-11", not "0-10"', errors)
        self.assertIn('extensions "octvertexnormals", not "none"', errors)
        self.assertNotIn("gzip", errors)
        self.assertEqual(files_of(other), [], "a refused worker leaves the place to others")
        _, errors = self.run_bake(other, code=2)
        self.assertIn("place (bake-place.id)", errors)
        self.redis("HSET", self.key("job"), "program", "terrace 0.0.1")
        _, errors = self.run_bake(place, code=2)
        self.assertIn('program "terrace 0.0.1", not "terrace ', errors)
        self.assertIn(f"--job {self.job} --remove", errors)
        self.status("--remove")
        self.assertEqual(self.redis("DBSIZE"), 0)
        worker.send_signal(signal.SIGCONT)
        self.end(worker)  # fills it again
        self.expect_equal(place)

    def test_a_bake_without_the_queue_is_kept_out(self):
        place = self.place()
        worker = self.start(place)
        worker.stdout.readline()
        worker.send_signal(signal.SIGSTOP)
        alone = subprocess.run([BINARY, "bake", "--config", self.config, "--levels", "0-11", "--out", place], env=self.environment,
                               stderr=subprocess.PIPE, text=True)
        self.assertEqual((alone.returncode, f"process {worker.pid}" in alone.stderr), (1, True), alone.stderr)

    def test_garbage_in_the_queue_is_listed(self):
        place = self.place()
        worker = self.start(place)
        worker.stdout.readline()
        self.redis("XADD", self.key("units"), "*", "unit", "terrain/7-999-1")
        self.redis("XADD", self.key("units"), "*", "what", "else")
        self.redis("XADD", self.key("units"), "*", "unit", "x" * 100_000)
        out, errors = self.end(worker, 1)
        self.assertIn("unit terrain/7-999-1 failed: is no unit of this job", errors)
        self.assertIn("3 of 17 units failed", errors)
        self.run_bake(place)
        self.expect_equal(place)
        for key in ("job", "units", "dead"):
            place = self.place(key)
            self.redis("FLUSHALL")
            self.redis("SET", self.key(key), "garbage")
            _, errors = self.run_bake(place, code=0 if key != "job" else 2)
            if key == "job":
                self.assertIn("the key belongs to something else", errors)

    def expect_refusal(self, url, part, code, **options):
        place = self.place(f"refused-{part[:5]}")
        begun = time.monotonic()
        out, errors = self.run_bake(place, url=url, code=code, **options)
        self.assertIn(part, errors)
        self.assertNotIn("secret", out + errors)
        self.assertLess(time.monotonic() - begun, 60)
        self.assertEqual([name for name in files_of(place) if name.endswith((".lock", ".partial", ".pmtiles"))], [])

    def test_a_redis_that_cannot_be_used_is_refused_at_once(self):
        self.expect_refusal("redis://:secret@127.0.0.1:1/0", "cannot be reached", 1)
        self.expect_refusal("redis://nowhere.invalid:1/0", "host is not known", 1)
        self.expect_refusal(self.redis.url.replace("//", "//:secret@"), "has no password, but one was given", 2)
        self.expect_refusal("redis://u:secret@:6379", "has no host", 2)
        self.expect_refusal(self.redis.url + "99", "has no such database", 2)
        locked = self.start_redis("locked", "--requirepass", "open-sesame")
        self.expect_refusal(locked.url, "wants a password", 2)
        self.expect_refusal(locked.url.replace("//", "//:secret@"), "refuses the user or the password", 2)
        self.redis("CONFIG", "SET", "maxmemory-policy", "noeviction")
        self.redis("CONFIG", "SET", "maxmemory", 100_000)
        self.expect_refusal(self.redis.url, "is full (maxmemory)", 1)
        replica = self.start_redis("replica", "--replicaof", "127.0.0.1", "1")
        self.expect_refusal(replica.url, "is a read-only replica", 1)

    def test_what_is_no_redis_is_refused(self):
        def old(connection):
            info = b"# Server\r\nredis_version:6.0.16\r\nredis_mode:standalone\r\n"
            for text in (b"+PONG\r\n", b"$%d\r\n%s\r\n" % (len(info), info)):
                connection.recv(4096)
                connection.sendall(text)
            connection.recv(4096)

        def web(connection):
            connection.recv(4096)
            connection.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")
        for play, part, code in ((old, "version 6.0.16, and the queue needs 6.2", 2), (web, "does not speak Redis's protocol", 1)):
            listener = Listener(play)
            self.addCleanup(listener.close)
            self.expect_refusal(listener.url, part, code)
        cut = proxy(self.redis.port, lambda data: data[:len(data) // 2] if data.startswith(b"$") else data)
        self.addCleanup(cut.close)

        def cut_reply(data, state=[0]):
            state[0] += 1
            return data if state[0] == 1 else None
        ending = proxy(self.redis.port, cut_reply)
        self.addCleanup(ending.close)
        self.expect_refusal(ending.url, "closed the connection", 1)
        self.expect_refusal(cut.url, "did not reply in time", 1)

    def test_broken_and_slow_connections_do_no_harm(self):
        dice = random.Random(5)
        breaking = proxy(self.redis.port, lambda data: None if dice.random() < 0.2 else data)
        slow = proxy(self.redis.port, lambda data: time.sleep(1) or data)
        for name, through in (("breaking", breaking), ("slow", slow)):
            self.addCleanup(through.close)
            place = self.place(name)
            steady = self.start(place, lease=4)
            steady.stdout.readline()
            other = self.start(place, url=through.url, lease=4)
            out, errors = other.communicate(timeout=120)
            # At the start it is refused, later it waits.
            self.assertTrue(other.returncode == 0 or "closed the connection" in errors, errors)
            self.end(steady)
            self.expect_equal(place)

    def test_the_password_is_seen_nowhere(self):
        self.redis = self.start_redis("locked", "--requirepass", "open-sesame")
        place, file = self.place(), self.scratch / "password"
        file.write_text("open-sesame\n")
        worker = self.start(place, "--queue-password-file", file)
        self.assertNotIn(b"sesame", pathlib.Path(f"/proc/{worker.pid}/cmdline").read_bytes())
        first = worker.stdout.readline()
        out = subprocess.run([BINARY, "bake", "status", "--queue", self.redis.url, "--job", self.job, "--json"], text=True,
                             env={**self.environment, "TERRACE_QUEUE_PASSWORD": "open-sesame"}, stdout=subprocess.PIPE)
        self.assertEqual(json.loads(out.stdout)["state"], "baking")
        self.redis.kill()
        time.sleep(0.5)
        self.redis.start()
        rest, errors = self.end(worker)
        self.assertIn("Redis at redis://127.0.0.1", errors)
        self.assertNotIn("sesame", first + rest + errors + out.stdout)
        self.expect_equal(place)

    def test_status(self):
        place = self.place()
        self.assertIn("has no job test-job", subprocess.run(
            [BINARY, "bake", "status", "--queue", self.redis.url, "--job", self.job], stderr=subprocess.PIPE, text=True).stderr)
        worker = self.start(place, lease=1)
        worker.stdout.readline()
        worker.stdout.readline()
        worker.send_signal(signal.SIGSTOP)
        time.sleep(1.2)
        status = json.loads(self.status("--json"))
        self.assertEqual((status["state"], status["units"], len(status["running"]), status["dead"]), ("baking", 17, 1, []))
        self.assertEqual(status["done"] + status["waiting"] + 1, 17)
        running = status["running"][0]
        self.assertIn(f"-{worker.pid}-", running["worker"])
        self.assertGreater(running["seconds"], 1)
        self.assertGreater(running["silent_seconds"], 1)
        self.assertEqual(status["bake"]["levels"], "0-11")
        text = self.status()
        self.assertIn(f"{status['done']} of 17 units done, 1 running, {status['waiting']} waiting, 0 dead", text)
        self.assertIn("not heard of for", text)
        watch = subprocess.Popen([BINARY, "bake", "status", "--queue", self.redis.url, "--job", self.job, "--watch", "--json"],
                                 stdout=subprocess.PIPE, text=True)
        worker.send_signal(signal.SIGCONT)
        self.end(worker)
        lines = [json.loads(line) for line in watch.communicate(timeout=30)[0].splitlines()]
        self.assertEqual(lines[-1]["state"], "finished")
        self.assertEqual((lines[-1]["done"], lines[-1]["waiting"], lines[-1]["running"]), (17, 0, []))
        self.assertGreater(lines[-1]["units_per_hour"], 0)

    def test_arguments(self):
        for arguments, part in ((("--queue", "redis://h"), "--queue and --job belong together"), (("--job", "a"), "belong together"),
                                (("--queue", "redis://h", "--job", "a", "--shard", "0/2"), "leave --shard and --finish out"),
                                (("--queue", "redis://h", "--job", "a b"), '--job "a b": must have'),
                                (("--queue", "tcp://u:secret@h", "--job", "a"), "does not begin with redis://"),
                                (("--queue", "redis://h", "--job", "a", "--queue-password-file", "/nowhere"), "/nowhere"),
                                (("--queue", "redis://h", "--job", "a", "--form", "single"), "--form single")):
            with self.subTest(arguments):
                done = subprocess.run([BINARY, "bake", "--config", self.config, "--out", self.place(), *arguments], text=True,
                                      env=self.environment, stderr=subprocess.PIPE)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(part, done.stderr)
                self.assertNotIn("secret", done.stderr)


if __name__ == "__main__":
    unittest.main()
