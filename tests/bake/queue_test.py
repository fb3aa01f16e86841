"""Many bakers and one queue, with a real redis-server: queue_test.py BINARY [--long]. --long: 200 kills instead of 8."""
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time

from bake_case import BINARY, IS_LONG, files_of, write_hgt
from queue_case import QueueCase
import in_parallel  # bake_case has set the path

KILLS = 200 if IS_LONG else 8


class Queue(QueueCase):
    def test_workers_share_the_units(self):
        place = self.place()
        workers = [self.start(place, lease=20) for _ in range(4)]
        outputs = [out for out, _ in self.end_all(workers)]
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
        """Runs two workers to the end. One that was killed between manifest and good-bye leaves its traces to a third."""
        for worker in [self.start(place) for _ in range(2)]:
            worker.communicate()
        self.run_bake(place)
        self.expect_equal(place)

    def stop_within_a_unit(self, worker, place):
        """Its unit, and the id in the queue."""
        worker.stdout.readline()
        while True:
            worker.send_signal(signal.SIGSTOP)
            held = json.loads(self.status("--json"))["running"]
            unit = held[0]["unit"].split("/")[1] if held else ""
            if unit and not (place / "units" / f"{unit}.pmtiles").exists():
                return unit, self.redis("XPENDING", self.key("units"), "bakers", "-", "+", 1)[0][0]
            worker.send_signal(signal.SIGCONT)
            time.sleep(0.02)

    def test_a_stopped_worker_loses_its_unit_and_comes_back(self):
        place = self.place()
        first = self.start(place)
        unit, _ = self.stop_within_a_unit(first, place)
        out, _ = self.run_bake(place)  # waits for the lease, inherits, finishes
        self.assertIn(unit, self.baked(out))
        self.expect_equal(place)
        first.send_signal(signal.SIGCONT)
        self.end(first)
        self.expect_equal(place)

    def test_a_worker_that_is_late_sees_that_all_is_done(self):
        place = self.place()
        late = self.start(place)
        self.stop_within_a_unit(late, place)
        self.run_bake(place)
        # As if another late worker had begun the job anew, with a new number of the place.
        self.redis("HSET", self.key("job"), "state", "baking", "incarnation", "other", "place (bake-place.id)", "other")
        late.send_signal(signal.SIGCONT)
        _, errors = self.end(late)
        self.assertIn("is complete already", errors)
        self.expect_equal(place)

    @in_parallel.alone
    def test_a_slow_unit_is_not_inherited_while_its_worker_lives(self):
        place = self.place()
        lease = self.seconds / len(self.units) / 2
        workers = [self.start(place, lease=round(lease, 3)) for _ in range(3)]
        outputs = [out for out, _ in self.end_all(workers)]
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
        ends = self.end_all(workers, 1)
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

    def test_a_worker_that_always_fails_spoils_nothing(self):
        place, box = self.place(), ("--bbox", "12.4,30.4,12.6,30.6")
        right = self.start(place, *box, lease=120)
        right.stdout.readline()
        right.send_signal(signal.SIGSTOP)  # the other worker is heard of for a lease, and takes nothing
        broken = self.start(place, *box, lease=120, limit=1000)
        until = time.monotonic() + 100
        while not self.redis("HLEN", self.key("errors")) or self.redis("XLEN", self.key("units")) > self.redis("HLEN", self.key("errors")) + 1:
            self.assertLess(time.monotonic(), until)
            time.sleep(0.02)
        # Until it has asked for more in vain.
        name = next(name for name in self.redis("HKEYS", self.key("failed"))).split(" ", 1)[1]
        heard = self.redis("HGET", self.key("workers"), name)
        while self.redis("HGET", self.key("workers"), name) == heard:
            self.assertLess(time.monotonic(), until)
            time.sleep(0.02)
        deliveries = [entry[3] for entry in self.redis("XPENDING", self.key("units"), "bakers", "-", "+", 100)]
        self.assertEqual(set(deliveries), {1}, "a unit that failed is for the other worker")
        right.send_signal(signal.SIGCONT)
        self.end_all((right, broken))
        self.assertTrue((place / "manifest.json").exists())

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

    def test_a_unit_that_was_given_up_and_is_done_after_all_is_not_dead(self):
        place = self.place()
        first = self.start(place)
        unit, pending = self.stop_within_a_unit(first, place)
        self.redis("XCLAIM", self.key("units"), "bakers", "killed", 0, pending, "RETRYCOUNT", 3)
        _, errors = self.run_bake(place, code=1)
        self.assertIn(f"unit terrain/{unit} failed: its workers ended before it was done", errors)
        self.assertEqual(self.redis("XLEN", self.key("dead")), 1)
        first.send_signal(signal.SIGCONT)
        out, _ = self.end(first)
        self.assertIn(unit, self.baked(out))
        self.expect_equal(place)
        self.assertEqual(self.redis("XLEN", self.key("dead")), 0)

    def test_leftovers_of_the_killed_are_removed_at_the_end(self):
        place = self.place()
        first = self.start(place)
        unit, _ = self.stop_within_a_unit(first, place)
        first.kill()
        first.communicate()
        (place / "units" / f"{unit}.pmtiles.0badcafe.partial").write_text("of a kill while the file was written")
        left = [name for name in files_of(place) if name.endswith((".lock", ".partial"))]
        self.assertGreaterEqual(len(left), 2, left)  # three if it was killed while the file was written
        texts = {name: (place / name).read_bytes() for name in left}
        self.run_bake(place)
        self.expect_equal(place)
        for name, text in texts.items():  # as if it had been killed after the manifest was written
            (place / name).write_bytes(text)
        _, errors = self.run_bake(place)
        self.assertIn("is complete already", errors)
        self.expect_equal(place)
        for name, text in texts.items():
            (place / name).write_bytes(text)
        done = subprocess.run([BINARY, "bake", "--config", self.config, "--levels", "0-11", "--out", place, "--finish"], env=self.environment,
                              stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
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
        self.end_all([self.start(place, *formats, levels="0-8") for _ in range(2)])
        self.expect_equal(place, reference)

    def test_clocks_do_not_matter(self):
        place = self.place()
        wrong = {"FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        ahead = self.start(place, before=("faketime", "-f", "+1h"), environment=wrong, lease=20)
        behind = self.start(place, before=("faketime", "-f", "-1h"), environment=wrong, lease=20)
        right = self.start(place, lease=20)
        outputs = [out for out, _ in self.end_all((ahead, behind, right))]
        self.assertEqual(self.baked(*outputs), sorted(self.units), "no unit was inherited")
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


if __name__ == "__main__":
    in_parallel.main()
