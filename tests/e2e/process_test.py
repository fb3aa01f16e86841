"""Restarts of the real binary on a held socket, few file descriptors, no viewer: process_test.py BINARY SOURCE_DIR."""
import pathlib
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(SOURCE_DIR / "tests/reliability"))
import descriptors  # noqa: E402
import restarts  # noqa: E402

DEM = SOURCE_DIR / "config/samples/jacksboro.tif"


def listens(address):
    host, _, port = address.rpartition(":")
    with socket.socket() as connection:
        return connection.connect_ex((host, int(port))) == 0


class HeldSocket(unittest.TestCase):
    def test_loses_no_request_in_restarts(self):
        with tempfile.TemporaryDirectory() as folder:
            load = restarts.restart_under_load(BINARY, 3, 8, restarts.TARGETS, "--config", restarts.SAMPLES, "--worker-threads", "2",
                                               "--disk-cache", folder, "--log-level", "error")
        self.assertEqual(load.failures, [])
        self.assertGreater(load.count, 100)
        print(f"{load.count} requests, {load.again} sent again, slowest {load.slowest:.2f} s", file=sys.stderr)

    def test_is_served_instead_of_the_configured_address(self):
        with restarts.HeldSocket() as held:
            process = held.start(BINARY, "serve", DEM, "--listen", "127.0.0.1:1", "--log-level", "error")
            try:
                self.assertIn(f"http://127.0.0.1:{held.port}/", process.stdout.readline())
                self.assertEqual(urllib.request.urlopen(f"http://127.0.0.1:{held.port}/readyz", timeout=30).read(), b"ready\n")
            finally:
                process.terminate()
                process.stdout.close()
                self.assertEqual(process.wait(60), 0)

    def test_must_be_one_that_listens(self):
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            with self.subTest(kind=kind), socket.socket(socket.AF_INET, kind) as other:
                other.bind(("127.0.0.1", 0))
                number = other.fileno()
                done = subprocess.run(["bash", "-c", restarts.PASS, "bash", str(number), BINARY, "serve", DEM], pass_fds=(number,),
                                      capture_output=True, text=True, timeout=60, check=False)
                self.assertEqual(done.returncode, 1)
                self.assertIn("no listening TCP socket", done.stderr)


class Opening(unittest.TestCase):
    def test_ends_when_it_is_told_to(self):
        with tempfile.TemporaryDirectory() as folder:
            with socket.create_server(("127.0.0.1", 0)) as taken:
                address = f"127.0.0.1:{taken.getsockname()[1]}"
            slow = pathlib.Path(folder, "slow.tif")
            shutil.copy(DEM, slow)
            with restarts.leased(slow):
                # A folder, because its files are opened only with the dataset, not by the checks before.
                process = subprocess.Popen([BINARY, "serve", folder, "--listen", address, "--drain-timeout-s", "0.5"], text=True,
                                           stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                while not listens(address):
                    time.sleep(0.01)
                state = f"http://{address}/readyz"
                with self.assertRaises(urllib.error.HTTPError) as opening:
                    urllib.request.urlopen(state, timeout=30)
                self.assertEqual((opening.exception.code, opening.exception.read()), (503, b"opening\n"))
                self.assertEqual(urllib.request.urlopen(state.replace("readyz", "livez"), timeout=30).status, 200)
                process.send_signal(signal.SIGTERM)
                log = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, 1, log)  # the blocked open cannot be cancelled
            self.assertIn("look whether a source can be read", log)
            self.assertIn("stopped before any dataset was served", log)


class WithoutItsFiles(unittest.TestCase):
    def test_a_copied_binary_says_that_the_viewer_is_not_there(self):
        with tempfile.TemporaryDirectory() as folder:
            binary = shutil.copy(BINARY, pathlib.Path(folder, "a copy"))
            process = subprocess.Popen([binary, "serve", DEM, "--listen", "127.0.0.1:0", "--cache-dir", folder], text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            try:
                address = process.stdout.readline().split(" at ")[1].strip()
                self.assertIn(b"<h1>terrace</h1>", urllib.request.urlopen(address, timeout=30).read())
            finally:
                process.terminate()
                _, log = process.communicate(timeout=60)
            self.assertIn("viewer: ", log)
            self.assertIn("is not there: / lists the datasets", log)


class Descriptors(unittest.TestCase):
    def test_80_are_enough_for_two_disk_stores_and_a_reload(self):
        with tempfile.TemporaryDirectory() as folder:
            told = descriptors.serve_with_few(BINARY, SOURCE_DIR, pathlib.Path(folder), 80)
        print(told, file=sys.stderr)
        self.assertEqual(told.wrong, [])
        # Their number depends on when RocksDB merged some. 27 descriptors are for them.
        self.assertGreater(told.files, 50, "there are more files of records than descriptors for them")
        self.assertLess(told.most, 80)

    def test_too_few_are_told_at_the_start(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--worker-threads", "2", "--disk-cache", folder], text=True,
                                  capture_output=True, timeout=60, check=False,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (50, 50)))
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stdout, "")
        self.assertRegex(done.stderr, r"the limit on open files is 50, and this configuration takes \d+ at least: .*ulimit -n")


if __name__ == "__main__":
    unittest.main()
