"""A Redis that is lost, full, slow or none at all, and jobs that do not fit: queue_faults_test.py BINARY."""
import json
import pathlib
import random
import signal
import subprocess
import time

from bake_case import BINARY, files_of
from queue_case import QueueCase
import in_parallel  # bake_case has set the path
from redis_process import Listener, proxy


class QueueFaults(QueueCase):
    def test_redis_that_is_killed_comes_back_from_its_aof(self):
        self.redis = self.start_redis("aof", "--appendonly", "yes", "--appendfsync", "always")
        place = self.place()
        workers = self.joined(place, 3)
        line = workers[0].stdout.readline()
        self.redis.kill()
        time.sleep(self.seconds / 4)
        self.redis.start()
        self.assertEqual(self.redis("EXISTS", self.key("units")), 1, "the AOF was read")
        ends = self.end_all(workers)
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
        ends = self.end_all(workers)
        self.expect_equal(place)
        self.assertEqual(sorted(set(self.baked(line, *(out for out, _ in ends)))), sorted(self.units))

    def test_an_emptied_redis_is_filled_again(self):
        for command in (("FLUSHALL",), ("DEL", self.key("units")), ("XGROUP", "DESTROY", self.key("units"), "bakers")):
            place = self.place(command[0])
            workers = self.joined(place, 2)
            workers[0].stdout.readline()
            self.redis(*command)
            self.end_all(workers)
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
        self.redis("XADD", self.key("units"), "*", "unit", "\x1b[2J" + "x" * 100_000)
        out, errors = self.end(worker, 1)
        self.assertIn("unit terrain/7-999-1 failed: is no unit of this job", errors)
        self.assertIn("3 of 17 units failed", errors)
        listed = errors + self.status(code=1)
        self.assertIn("unit \\x1b[2Jxxx", listed)
        self.assertNotIn("\x1b", listed)
        self.assertLess(len(listed), 5000)
        self.run_bake(place)
        self.expect_equal(place)
        for key in ("job", "units", "dead"):
            place = self.place(key)
            self.redis("FLUSHALL")
            self.redis("SET", self.key(key), "garbage")
            _, errors = self.run_bake(place, code=0 if key != "job" else 2)
            if key == "job":
                self.assertIn("the key belongs to something else", errors)

    def test_keys_that_become_something_else(self):
        for key in ("units", "dead", "taken", "done", "errors"):
            place = self.place(key)
            workers = self.joined(place, 2)
            workers[0].stdout.readline()
            self.redis("DEL", self.key(key))
            self.redis("SET", self.key(key), "garbage")
            self.end_all(workers)
            self.expect_equal(place)
            self.redis("FLUSHALL")

    def expect_refusal(self, url, part, code, timeout=None, **options):
        place = self.place(f"refused-{part[:5]}")
        begun = time.monotonic()
        arguments = ("--queue-timeout", timeout) if timeout else ()
        out, errors = self.run_bake(place, *arguments, url=url, code=code, **options)
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
        self.expect_refusal(cut.url, "did not reply in time", 1, timeout=1)

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

    def test_a_worker_ends_while_redis_is_frozen(self):
        silent = Listener(lambda connection: connection.recv(4096) and time.sleep(600))
        self.addCleanup(silent.close)
        place = self.place("silent")
        worker = self.start(place, "--queue-timeout", 3600, url=silent.url)  # the test would wait for an hour
        until = time.monotonic() + 60
        while not any(name.endswith(".lock") for name in files_of(place)):
            self.assertLess(time.monotonic(), until)
            time.sleep(0.01)
        worker.send_signal(signal.SIGTERM)
        self.end(worker, 143)
        place = self.place()
        worker = self.start(place, "--queue-timeout", 3600, lease=600)
        worker.stdout.readline()
        self.redis.process.send_signal(signal.SIGSTOP)
        worker.send_signal(signal.SIGTERM)
        _, errors = self.end(worker, 143)
        self.redis.process.send_signal(signal.SIGCONT)
        self.assertIn("Redis does not reply, so other workers get its units when their lease has ended", errors)
        self.assertNotIn("waiting for it", errors)
        self.assertEqual([name for name in files_of(place) if name.endswith((".partial", ".lock"))], [])

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
    in_parallel.main()
