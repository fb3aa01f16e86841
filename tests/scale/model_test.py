"""The simulation of model.py: what must hold of it whatever the times are."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import model  # noqa: E402

TIMES = model.Times({"hit_s": 0.001, "disk_s": 0.002, "builds_s": [0.1]})


class Model(unittest.TestCase):
    def test_a_node_more_or_less_moves_its_keys_alone(self):
        keys = [(7, x, y) for x in range(100) for y in range(100)]
        for count in (2, 3, 10):
            small, large = model.Ring(range(count)), model.Ring(range(count + 1))
            moved = [key for key in keys if small.node_of(key) != large.node_of(key)]
            self.assertEqual({large.node_of(key) for key in moved}, {count})
            self.assertLess(abs(len(moved) / len(keys) - 1 / (count + 1)), 0.06)

    def test_requests_for_a_tile_that_is_being_built_wait_for_that_build(self):
        fleet = model.Fleet(1, 1, 10, TIMES)
        replies = list(fleet.run([(0.0, "a"), (0.04, "a"), (0.05, "b"), (1.0, "a")]))
        self.assertEqual([what for _, _, what, _ in replies], ["build", "joined", "build", "hit"])
        self.assertEqual([round(seconds, 3) for _, seconds, _, _ in replies], [0.101, 0.061, 0.151, 0.001])

    def test_the_least_recently_used_tile_goes_and_may_be_on_disk(self):
        for has_disk, last in ((False, "build"), (True, "disk")):
            fleet = model.Fleet(1, 1, 2, TIMES, has_disk=has_disk)
            whats = [what for _, _, what, _ in fleet.run([(float(i), key) for i, key in enumerate("abacb")])]
            self.assertEqual(whats, ["build", "build", "hit", "build", last])

    def test_a_lost_node_loses_its_tiles_and_a_change_of_data_all(self):
        keys = [(7, x, 0) for x in range(200)]
        warm = [(float(i), key) for i, key in enumerate(keys)]
        again = [(1000.0 + i, key) for i, key in enumerate(keys)]
        fleet = model.Fleet(4, 1, 1000, TIMES)
        rebuilt = [r for r in fleet.run(warm + again, [(900.0, lambda f: f.lose(2))]) if r[0] >= 1000 and r[2] == "build"]
        self.assertLess(abs(len(rebuilt) / len(keys) - 1 / 4), 0.12)
        fleet = model.Fleet(4, 1, 1000, TIMES)
        changes = [(900.0, lambda f, i=i: f.change_data(i)) for i in range(4)]
        self.assertEqual(sum(r[2] == "build" for r in fleet.run(warm + again, changes)), 2 * len(keys))

    def test_traffic_has_its_rate_and_its_order(self):
        requests = list(model.mixed(500, 20))
        self.assertLess(abs(len(requests) / 20 - 500), 50)
        self.assertEqual(requests, sorted(requests, key=lambda r: r[0]))
        for _, (level, x, y) in requests:
            self.assertTrue(0 <= x < 2 ** (level + 1) and 0 <= y < 2 ** level, (level, x, y))


if __name__ == "__main__":
    unittest.main()
