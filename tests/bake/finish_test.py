"""What `terrace bake` does with files that are there: finish_test.py BINARY."""
import os
import pathlib
import shutil
import socket
import subprocess
import unittest

from bake_case import BakeCase, files_of


class Finish(BakeCase):
    THREADS = 2

    def test_shards_and_finish_make_the_same_files(self):
        place = self.place("shards")
        for shard in range(3):
            done = self.run_bake("--out", place, "--shard", f"{shard}/3")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertFalse((place / "manifest.json").exists())
            if shard == 1:
                early = self.run_bake("--out", place, "--finish")
                self.assertEqual(early.returncode, 1)
                self.assertIn("is missing", early.stderr)
                self.assertFalse((place / "manifest.json").exists())
        self.assertEqual(self.run_bake("--out", place, "--finish").returncode, 0)
        self.expect_equal(place)

    def test_a_finished_bake_is_kept(self):
        place = self.place("finished")
        shutil.copytree(self.reference, place)
        done = self.run_bake("--out", place, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(set(self.units(done).values()), {"kept"})
        self.expect_equal(place)
        config = self.make_sources("newer", (3, 0, 0, 0))
        newer = self.run_bake("--out", place, config=config)
        self.assertEqual(newer.returncode, 2)
        self.assertIn("--update", newer.stderr)
        self.expect_equal(place)

    def test_a_bake_that_lost_its_manifest_gets_it_again(self):
        for arguments in ((), ("--finish",)):
            place = self.place(f"lost{len(arguments)}")
            shutil.copytree(self.reference, place)
            (place / "manifest.json").unlink()
            done = self.run_bake("--out", place, "--json", *arguments)
            self.assertEqual((done.returncode, set(self.units(done).values())), (0, {"kept"}), done.stderr)
            self.expect_equal(place)

    def test_finish_says_which_units_are_missing_or_cannot_be_used(self):
        place, newer = self.place("damaged"), self.place("newer")
        shutil.copytree(self.reference, place)
        self.assertEqual(self.run_bake("--out", newer, "--no-gzip").returncode, 0)
        missing, damaged, cut, foreign = sorted((place / "units").glob("*.pmtiles"))[:4]
        missing.unlink()
        data = bytearray(damaged.read_bytes())
        data[-1] ^= 1
        damaged.write_bytes(data)
        cut.write_bytes(cut.read_bytes()[:-1])
        shutil.copy(newer / "units" / foreign.name, foreign)
        done = self.run_bake("--out", place, "--finish", "--json")
        self.assertEqual(done.returncode, 1)
        self.assertEqual({unit: outcome for unit, outcome in self.units(done).items() if outcome != "kept"},
                         {missing.stem: "missing", damaged.stem: "unusable", cut.stem: "unusable", foreign.stem: "unusable"})
        for said in (f"unit {missing.stem} of terrain is missing\n",
                     f"unit {damaged.stem} of terrain cannot be used: {damaged} is damaged: the checksum of tile",
                     f"unit {cut.stem} of terrain cannot be used: {cut} is damaged",
                     f"unit {foreign.stem} of terrain cannot be used: {foreign} was baked from other sources or with other options",
                     "4 of 17 files are not done, and no manifest was written; run the same command without --finish, or the shards"):
            self.assertIn(said, done.stderr)
        done = self.run_bake("--out", place, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({unit for unit, outcome in self.units(done).items() if outcome == "baked"},
                         {missing.stem, damaged.stem, cut.stem, foreign.stem})
        self.expect_equal(place)

    def test_a_place_that_does_not_name_its_bake_is_refused(self):
        place = self.place("nameless")
        shutil.copytree(self.reference, place, ignore=shutil.ignore_patterns("*.json"))
        files = files_of(place)
        for arguments in ((), ("--finish",)):
            done = self.run_bake("--out", place, *arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("neither bake.json nor manifest.json says of which bake; give an empty or a new folder", done.stderr)
        self.assertEqual(files_of(place), files)

    def machine(self):
        """The machine as locks state it: from that of a bake that is killed long before its end."""
        place = self.place("stopped")
        lock = place / "bake.lock"
        bake = subprocess.Popen(self.command("--out", place, levels="0-13"), env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not lock.is_file():
            self.assertIsNone(bake.poll())
        bake.kill()
        bake.wait()
        return lock.read_text().split()[5]

    def test_the_lock_of_another_machine_with_the_same_name_stays(self):
        place, host = self.place("locked"), socket.gethostname()
        place.mkdir()
        boot = pathlib.Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        space = os.readlink("/proc/self/ns/pid")
        ended = subprocess.Popen("true")
        ended.wait()
        lock = place / "bake.lock"
        machine = self.machine()
        for other in (f"{boot[::-1]} {space}", f"{boot[::-1]} {space} {'0' * 16}", f"{boot[::-1]} {space} unknown", f"{boot[::-1]} pid:[1] {machine}",
                      f"{boot} pid:[1]", f"unknown {space} {machine}"):
            lock.write_text(f"{host} {ended.pid} 1 {other}\n")
            done = self.run_bake("--out", place)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn(f"process {ended.pid} on host {host} is baking there; wait for it, or remove {lock}", done.stderr)
            self.assertEqual(files_of(place), ["bake.lock"])
        # Before the machine was started again, and under another name.
        is_container = space != "pid:[4026531836]"
        restarted = [] if machine == "unknown" or is_container else [f"{host} {ended.pid} 1 {boot[::-1]} {space} {machine}"]
        for own in (*restarted, f"other-name {ended.pid} 1 {boot} {space}"):
            lock.write_text(own + "\n")
            done = self.run_bake("--out", place)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.expect_equal(place)

    def test_files_that_are_not_of_a_bake_stay(self):
        place = self.place("foreign")
        (place / "units").mkdir(parents=True)
        (place / "units/mine.pmtiles").touch()
        done = self.run_bake("--out", place)
        self.assertEqual((done.returncode, "holds units" in done.stderr), (2, True), done.stderr)
        self.assertTrue((place / "units/mine.pmtiles").exists())


if __name__ == "__main__":
    unittest.main()
