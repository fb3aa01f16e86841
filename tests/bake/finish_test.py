"""What `terrace bake` does with files that are there: finish_test.py BINARY."""
import shutil
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

    def test_a_place_that_does_not_name_its_bake_is_refused(self):
        place = self.place("nameless")
        shutil.copytree(self.reference, place, ignore=shutil.ignore_patterns("*.json"))
        files = files_of(place)
        for arguments in ((), ("--finish",)):
            done = self.run_bake("--out", place, *arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("neither bake.json nor manifest.json says of which bake; give an empty or a new folder", done.stderr)
        self.assertEqual(files_of(place), files)

    def test_files_that_are_not_of_a_bake_stay(self):
        place = self.place("foreign")
        (place / "units").mkdir(parents=True)
        (place / "units/mine.pmtiles").touch()
        done = self.run_bake("--out", place)
        self.assertEqual((done.returncode, "holds units" in done.stderr), (2, True), done.stderr)
        self.assertTrue((place / "units/mine.pmtiles").exists())


if __name__ == "__main__":
    unittest.main()
