"""The effect of options of `terrace serve` on replies and logs: serve_options_test.py BINARY SOURCE_DIR."""
import contextlib
import fcntl
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
DEM = SOURCE_DIR / "config/samples/jacksboro.tif"
TILE = "9/272/359"


@contextlib.contextmanager
def serving(config, log):
    """Yields the URL of a server with this configuration. Afterwards the server must end cleanly, and `log` has its lines."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "terrace.json")
        path.write_text(json.dumps(config))
        process = subprocess.Popen([BINARY, "serve", "--config", path, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        try:
            first = process.stdout.readline()
            found = re.search(r"http://\S+/", first)
            if found is None:
                raise AssertionError(process.communicate()[1])
            yield found[0], process
        finally:
            process.terminate()
            log += process.communicate(timeout=60)[1].splitlines()
    if process.returncode != 0:
        raise AssertionError(f"ended with {process.returncode}")


def gltf(body):
    length = struct.unpack_from("<I", body, 12)[0]
    return json.loads(body[20:20 + length])


def photograph(folder):
    """Three bands of 64 x 64 pixels over the whole of the DEM."""
    path = pathlib.Path(folder, "photo.img")
    path.write_bytes(bytes(x * y % 251 for band in range(3) for y in range(64) for x in range(64)))
    path.with_suffix(".hdr").write_text(
        "ENVI\nsamples = 64\nlines = 64\nbands = 3\ndata type = 1\ninterleave = bsq\nbyte order = 0\n"
        "map info = {Geographic Lat/Lon, 1, 1, -84.5, 36.5, 0.01, 0.01, WGS-84}\n")
    return str(path)


class Glb(unittest.TestCase):
    def test_is_compressed_and_textured_as_the_dataset_says(self):
        used = {"draco": "KHR_draco_mesh_compression", "quantized": "KHR_mesh_quantization", "meshopt": "EXT_meshopt_compression"}
        with tempfile.TemporaryDirectory() as folder:
            imagery = {"image": photograph(folder), "size": 64}
            datasets = [{"name": form, "sources": [str(DEM)], "glb_compression": form} for form in ("draco", "none", "quantized", "meshopt")]
            datasets += [{"name": texture, "sources": [str(DEM)], "glb_compression": "none", "imagery": imagery | {"texture": texture}}
                         for texture in ("jpeg", "webp")]
            with serving({"datasets": datasets, "log_level": "off"}, log := []) as (url, _):
                for dataset in datasets:
                    with self.subTest(dataset=dataset["name"]), urllib.request.urlopen(f"{url}{dataset['name']}/{TILE}.glb", timeout=60) as reply:
                        model = gltf(reply.read())
                        compression = used.get(dataset["glb_compression"])
                        for extension in used.values():
                            # meshopt's integers are those of KHR_mesh_quantization
                            if compression != used["meshopt"] or extension != used["quantized"]:
                                self.assertEqual(extension in model.get("extensionsUsed", []), extension == compression)
                        images = [image["mimeType"] for image in model.get("images", [])]
                        self.assertEqual(images, [f"image/{dataset['name']}"] if "imagery" in dataset else [])
        self.assertEqual(log, [], "of the level `off`")


class Log(unittest.TestCase):
    def test_outlives_whoever_reads_it(self):
        process = subprocess.Popen([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--access-log", "log"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        try:
            url = re.search(r"http://\S+/", process.stdout.readline())[0]
            process.stderr.close()
            for _ in range(3):
                self.assertEqual(urllib.request.urlopen(url + "livez", timeout=10).status, 200)
        finally:
            process.terminate()
            process.stdout.close()
        self.assertEqual(process.wait(30), 0)

    def test_stops_nothing_when_its_reader_stalls(self):
        asked = 1500  # lines of more than 100 bytes, twice the capacity of a pipe
        process = subprocess.Popen([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--access-log", "log"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        try:
            url = re.search(r"http://\S+/", process.stdout.readline())[0]
            for _ in range(asked):
                self.assertEqual(urllib.request.urlopen(url + "livez", timeout=30).status, 200)
            while "/livez" not in process.stderr.readline():  # the test reads again
                pass
            os.set_blocking(process.stderr.fileno(), False)
            while process.stderr.buffer.read():
                pass
            os.set_blocking(process.stderr.fileno(), True)
            urllib.request.urlopen(url + "livez", timeout=30)
        finally:
            process.terminate()
            log = process.communicate(timeout=30)[1]
        self.assertEqual(process.returncode, 0)
        missing = int(re.search(r"dropped (\d+) lines before the last one", log)[1])
        self.assertLess(missing, asked)
        self.assertGreater(missing, 0)

    def test_keeps_no_server_from_ending(self):
        process = subprocess.Popen([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--access-log", "combined"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        url = re.search(r"http://\S+/", process.stdout.readline())[0]
        for _ in range(1500):
            self.assertEqual(urllib.request.urlopen(url + "livez", timeout=30).status, 200)
        process.terminate()
        self.assertEqual(process.wait(30), 0)
        process.stdout.close()
        process.stderr.close()

    def test_is_json_on_request(self):
        config = {"datasets": [{"name": "maui", "sources": [str(DEM)]}], "log_format": "json", "log_level": "info"}
        with serving(config, log := []) as (url, _):
            with urllib.request.urlopen(f"{url}livez", timeout=60) as reply:
                reply.read()
        lines = [json.loads(line) for line in log]
        self.assertTrue(any("/livez" in line["message"] for line in lines), log)
        for line in lines:
            self.assertEqual(set(line), {"time", "level", "message"})

    def test_levels_hold_back_what_is_below(self):
        for level, told in (("error", False), ("warn", True)):  # a missing vertical datum is a warning
            with serving({"datasets": [{"name": "maui", "sources": [str(DEM)]}], "log_level": level}, log := []):
                pass
            self.assertEqual(any("vertical datum" in line for line in log), told, log)

    def test_a_signal_makes_it_talk_and_another_ends_that(self):
        with serving({"datasets": [{"name": "maui", "sources": [str(DEM)]}], "log_level": "error"}, []) as (url, process):
            for number, level in ((signal.SIGUSR1, "debug"), (signal.SIGUSR2, "error")):
                process.send_signal(number)
                while f"log level: {level}" not in (line := process.stderr.readline()):
                    self.assertNotEqual(line, "", "the log has ended")


class AccessLog(unittest.TestCase):
    def lines(self, form):
        with serving({"datasets": [{"name": "maui", "sources": [str(DEM)]}], "access_log": form, "log_level": "error"}, log := []) as (url, _):
            with urllib.request.urlopen(f"{url}livez", timeout=60) as reply:
                reply.read()
        return [line for line in log if "/livez" in line]

    def test_has_the_form_that_was_asked_for(self):
        self.assertRegex(self.lines("combined")[0], r'^127\.0\.0\.1 - - \[.+\] "GET /livez HTTP/1\.1" 200 \d+ ')
        self.assertEqual(json.loads(self.lines("json")[0])["target"], "/livez")
        self.assertEqual(self.lines("off"), [])


class HangUp(unittest.TestCase):
    def test_reopens_the_log_and_serves_on_without_a_configuration(self):
        with tempfile.TemporaryDirectory() as folder:
            log = pathlib.Path(folder, "access.log")
            process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", "--access-log", "combined", "--access-log-file",
                                        log, DEM], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            self.addCleanup(process.stdout.close)
            try:
                url = re.search(r"http://\S+/", process.stdout.readline())[0]
                log.rename(log.with_suffix(".1"))
                process.send_signal(signal.SIGHUP)
                deadline, sent = time.monotonic() + 30, 0
                while not (log.exists() and log.read_text()) and time.monotonic() < deadline:
                    urllib.request.urlopen(url + "readyz", timeout=30).read()
                    sent += 1
            finally:
                process.terminate()
            self.assertEqual(process.wait(60), 0)
            self.assertTrue(log.exists(), "the log was not opened anew")
            self.assertIn("/readyz", log.read_text())
            # Requests before the change are in the old file, and none is lost.
            self.assertEqual((log.with_suffix(".1").read_text() + log.read_text()).count("/readyz"), sent)


class Stopping(unittest.TestCase):
    def start(self, *arguments):
        process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", *arguments], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        port = int(re.search(r":(\d+)/", process.stdout.readline())[1])
        return process, port

    def wait_for(self, stream, text):
        for line in stream:
            if text in line:
                return
        self.fail(f"the log ended without {text!r}")

    def test_says_which_signal_it_was(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            process, _ = self.start(DEM)
            process.send_signal(number)
            log = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, 0, log)
            self.assertIn(f"stopping: {number.name}; a second one", log)
            self.assertIn(" stopped; no request is left unanswered", log)

    def test_a_second_signal_ends_it_at_once(self):
        process, port = self.start("--drain-timeout-s", "3600", "--header-timeout-s", "600", DEM)
        with socket.create_connection(("127.0.0.1", port)) as unfinished:
            unfinished.sendall(b"GET /livez HTTP/1.1\r\n")
            urllib.request.urlopen(f"http://127.0.0.1:{port}/livez", timeout=30).read()
            process.terminate()
            self.wait_for(process.stderr, "a second one ends the server at once")
            with self.assertRaises(subprocess.TimeoutExpired):
                process.wait(1)  # for the unfinished request
            process.terminate()
            process.communicate(timeout=60)
        self.assertEqual(process.returncode, 1)

    def test_a_source_that_cannot_be_read_does_not_keep_it(self):
        """Opening a file with a write lease of another process blocks for up to 45 s, as on a mount that does not answer."""
        signal.signal(signal.SIGIO, signal.SIG_IGN)
        with tempfile.TemporaryDirectory() as folder:
            source, beside = pathlib.Path(folder, "source.tif"), pathlib.Path(folder, "beside.tif")
            shutil.copy2(DEM, source)
            shutil.copy(DEM, beside)
            process, port = self.start("--drain-timeout-s", "0.2", source)
            with open(beside, "rb+") as leased:
                fcntl.fcntl(leased, fcntl.F_SETLEASE, fcntl.F_WRLCK)
                os.rename(beside, source)
                self.wait_for(process.stderr, "opening")
                while fcntl.fcntl(leased, fcntl.F_GETLEASE) == fcntl.F_WRLCK:  # until the server opens the file
                    time.sleep(0.01)
                process.terminate()
                log = process.communicate(timeout=120)[1]
            self.assertEqual(process.returncode, 1, log)
            self.assertIn("look whether a source can be read", log)


class WorkingDirectory(unittest.TestCase):
    """Paths on the command line are relative to the folder at the start, also if that folder is renamed or removed."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "run").mkdir()
        shutil.copy2(DEM, self.folder / "beside.tif")
        config = {"datasets": [{"name": "configured", "sources": ["beside.tif"]}]}
        (self.folder / "terrace.json").write_text(json.dumps(config))

    def outlive(self, leave, expected, *arguments):
        """The replies of /readyz after the start, and after `leave` and a few checks of the files, when the last is expected."""
        log = tempfile.TemporaryFile("w+")
        self.addCleanup(log.close)
        process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", *arguments], cwd=self.folder / "run",
                                   stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            url = re.search(r"http://\S+/", process.stdout.readline())[0]
            tile = urllib.request.urlopen(f"{url}{self.dataset}/{TILE}.terrain", timeout=30).read()
            states = [urllib.request.urlopen(url + "readyz", timeout=30).read().splitlines()[0]]
            leave()
            time.sleep(3)
            process.send_signal(signal.SIGHUP)
            time.sleep(1)
            # On a slow machine, a change is seen later.
            until = time.monotonic() + 60
            while (state := urllib.request.urlopen(url + "readyz", timeout=30).read().splitlines()[0]) != expected and time.monotonic() < until:
                time.sleep(0.1)
            states.append(state)
            self.assertEqual(urllib.request.urlopen(f"{url}{self.dataset}/{TILE}.terrain", timeout=30).read(), tile)
        finally:
            process.terminate()
            process.stdout.close()
            log.seek(0)
            self.assertEqual(process.wait(60), 0, log.read())
        return states

    def remove(self):
        shutil.rmtree(self.folder / "run")

    def test_may_be_removed(self):
        self.dataset = "beside"
        flags = ("--config", "../terrace.json", "--cache-dir", "../cache", "--data-roots", "..")
        self.assertEqual(self.outlive(self.remove, b"ready", *flags, "../beside.tif"), [b"ready", b"ready"])

    def test_may_be_removed_with_the_sources(self):
        shutil.copy2(DEM, self.folder / "run/inside.tif")
        self.dataset = "inside"
        self.assertEqual(self.outlive(self.remove, b"degraded", "--config", "../terrace.json", "inside.tif"), [b"ready", b"degraded"])

    def test_may_be_renamed(self):
        def rename():
            os.rename(self.folder / "run", self.folder / "gone")
            os.symlink("gone", self.folder / "run")

        shutil.copy2(DEM, self.folder / "run/inside.tif")
        self.dataset = "inside"
        self.assertEqual(self.outlive(rename, b"ready", "--config", "../terrace.json", "inside.tif"), [b"ready", b"ready"])

    def test_must_have_a_name_at_the_start_where_names_count_from_it(self):
        def start(*arguments):
            return subprocess.run(["sh", "-c", 'cd "$1" && rmdir "$1" && shift && exec "$@"', "sh", self.folder / "run", BINARY,
                                   "serve", "--print-config", *arguments], capture_output=True, text=True, timeout=60)

        result = start("dem.tif", "--cache-dir", "cache")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertRegex(result.stderr, r"(?m)^  dem\.tif: .*cannot be named; give the path in full$")
        self.assertRegex(result.stderr, r"(?m)^  --cache-dir: .*cannot be named; give the path in full$")
        (self.folder / "run").mkdir()
        self.assertEqual(start(DEM, "--cache-dir", "/cache").returncode, 0)


class Info(unittest.TestCase):
    def test_goes_on_after_a_name_that_is_none(self):
        done = subprocess.run([BINARY, "info", "", DEM], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("terrace: ", done.stderr)
        self.assertIn(str(DEM), done.stdout)


if __name__ == "__main__":
    unittest.main()
