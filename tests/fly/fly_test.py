"""terrace fly against the real server, sound and with faults between: fly_test.py BINARY SOURCE_DIR."""
import gzip
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import threading
import time
import unittest
import urllib.request

import fault_proxy
import flights
import in_parallel  # flights has set the path
from flights import BINARY, DEM, WAY, Configured, fly, fly_to, fly_with_fault


class SoundServer(unittest.TestCase):
    def test_loads_the_view_in_both_formats(self):
        for tiles in ("terrain", "3dtiles"):
            with self.subTest(format=tiles), tempfile.TemporaryDirectory() as folder:
                urls, page, earlier = pathlib.Path(folder, "urls"), pathlib.Path(folder, "page.html"), pathlib.Path(folder, "earlier")
                page.write_text("an earlier report")
                earlier.hardlink_to(page)
                status, report = fly(flights.UPSTREAM, "--format", tiles, "--forbid-holes", "--urls", urls, "--report", page,
                                     "--require", "full-view=60s,errors=0,refusals=0,holes=0,screen-error=1000px")
                summary = report["summary"]
                self.assertEqual(status, 0, summary)
                self.assertEqual(summary["outcomes"]["ok"], summary["tiles"] + summary["other_requests"])
                self.assertGreater(summary["tiles"], 60)
                self.assertGreater(summary["triangles"], 10_000)
                self.assertGreater(summary["holes"]["examined_frames"], 3)
                self.assertEqual(summary["holes"]["uncovered_frames"], 0)
                self.assertLessEqual(summary["connections"], 20)
                self.assertEqual(summary["incomplete_tiles"], 0)
                self.assertEqual(sum(summary["cache"].values()), summary["tiles"])
                self.assertEqual(summary["cache"]["unknown"], 0)
                lines = urls.read_text().split()
                self.assertEqual(len(lines), len(set(lines)))
                self.assertGreaterEqual(len(lines), summary["tiles"])
                self.assertTrue(all(line.startswith("/jacksboro/") and "v=" in line for line in lines))
                text = page.read_text()
                self.assertTrue(text.startswith("<!doctype html>") and text.endswith("</html>\n"))
                self.assertNotRegex(text, r"<script|src=|@import|url\(")
                self.assertEqual(earlier.read_text(), "an earlier report", "the new one replaces it, and does not overwrite it")
                self.assertEqual({file.name for file in page.parent.iterdir()}, {"urls", "page.html", "earlier"})

    def test_states_no_error_of_tiles_around_the_camera(self):
        status, report = fly(flights.UPSTREAM, way=["--from", "-84.25,36.3,650", "--to", "-84.25,36.3,650"], duration="1")  # between heights of the tile
        self.assertEqual(status, 0)
        self.assertGreater(report["summary"]["screen_error_px"]["stated_max"], 0)
        self.assertLess(report["summary"]["screen_error_px"]["stated_max"], 9999)

    @staticmethod
    def fly_with_roots(levels, roots, *options, **more):
        """(exit status, report) of a flight by a layer.json of that many levels, with these tiles at level 0."""
        def change(path, status, headers, body):
            if path.split("?")[0].endswith("layer.json"):
                headers.pop("Content-Encoding", None)
                document = json.loads(urllib.request.urlopen(f"http://{flights.UPSTREAM}/jacksboro/layer.json", timeout=60).read())
                document["available"] = [[roots], *document["available"][1:levels]]
                body = json.dumps(document).encode()
            return status, headers, body

        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=change) as proxy:
            return fly(proxy.address, *options, duration="1", **more)

    def test_says_that_the_place_is_wrong(self):
        for end in (1, 0):  # 0: nothing in the east
            status, report = self.fly_with_roots(99, {"startX": 0, "startY": 0, "endX": end, "endY": 0}, "--require",
                                                 "full-view=60s,refined=1%,holes=0,screen-error=1000px", way=["--circle", "84.25,36.3,1500,8000"])
            self.assertEqual(status, 1)
            self.assertGreater(report["summary"]["tiles"], 0)
            self.assertIn("no terrain of the dataset", " ".join(report["summary"]["findings"]))
        self.assertEqual([requirement["holds"] for requirement in report["requirements"]], [False] * 4)

    def test_takes_level_0_for_terrain_where_there_is_no_other(self):
        status, report = self.fly_with_roots(1, {"startX": 0, "startY": 0, "endX": 1, "endY": 0})
        self.assertEqual(status, 0, report)
        self.assertNotIn("no terrain", " ".join(report["summary"]["findings"]))
        self.assertLessEqual(report["summary"]["tiles"], 2)

    def test_takes_the_format_from_the_path_of_the_url(self):
        for path, form in (("a/layer.json?x=tileset.json", "terrain"), ("a/tileset.json?x=layer.json", "3dtiles")):
            _, report = fly("127.0.0.1:1", "--first-view-limit", "0.1", path=path)
            self.assertEqual(report["format"], form)

    def test_flies_with_several_clients(self):
        status, report = fly(flights.UPSTREAM, "--clients", "3", way=["--circle", "-84.25,36.3,3000,5000"])
        self.assertEqual(status, 0)
        self.assertEqual(report["summary"]["clients"], 3)
        self.assertEqual(report["summary"]["clients_without_full_view"], 0)

    def test_explains_wrong_arguments(self):
        for options, part in ((["--from", "1,2,3"], "exactly one path"), (["--circle", "1,2,3"], "--circle 1,2,3: give"),
                              (["--circle", "1,2,-6400000,3000"], "--circle 1,2,-6400000,3000: the height must be a number from -12000 to 100000000 m; give"),
                              (["--circle", "1,2,1e300,3000"], "the height must be"), (["--circle", "1,91,3,3000"], "no longitude and latitude"),
                              (["--circle", "1,2,3,5e6"], "the radius must be above 0 and below 5000000 m"),
                              (["--from", "1,2,3", "--to", "1,2,1e9"], "--to 1,2,1e9: the height must be"),
                              (["--path", "/nowhere"], "cannot be read"), ([*WAY, "--require", "p98=1s"], "p98=1s"),
                              *(([*WAY, "--header", header], "Name: value") for header in ("x", "Foo Bar: x", ": x", "A: b\rC: d"))):
            with self.subTest(options=options):
                done = subprocess.run([BINARY, "fly", f"http://{flights.UPSTREAM}/jacksboro", *options], capture_output=True, text=True, timeout=60,
                                      check=False)
                self.assertEqual(done.returncode, 2)
                self.assertIn(part, done.stderr)

    def test_refuses_what_is_no_number_of_its_range(self):
        numbers = {"--speed": 1e8, "--pitch": -91, "--duration": 604801, "--sse": 0.4, "--fps": 241, "--fov": 171, "--timeout": 0,
                   "--first-view-limit": 3601}
        for flag, outside in numbers.items():
            for value in ("nan", "inf", "fast", outside):
                with self.subTest(flag=flag, value=value):
                    done = subprocess.run([BINARY, "fly", f"http://{flights.UPSTREAM}/jacksboro", *WAY[:4], f"{flag}={value}"], capture_output=True,
                                          text=True, timeout=60, check=False)
                    self.assertEqual((done.returncode, done.stdout), (2, ""))
                    self.assertRegex(done.stderr, rf'^terrace: {flag}: must be a number [^"]*from \S+ to \d+, not "{value}"\n')
        done = subprocess.run([BINARY, "fly", f"http://{flights.UPSTREAM}/jacksboro", *WAY, "--clients", "1.5"], capture_output=True, text=True,
                              timeout=60, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn('--clients: must be a whole number from 1 to 1000, not "1.5"', done.stderr)

    def test_says_before_the_flight_that_a_report_cannot_be_written(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "path.csv"
            path.write_text("-84.3,36.3,3000\n-84.2,36.35,3000\n")
            for option, file, code, part in (("--report", f"{folder}/no/a.html", 1, "cannot write {}: No such file or directory"),
                                             ("--urls", f"{folder}/no/a.txt", 1, "cannot write {}: No such file or directory"),
                                             ("--report", path, 2, "{} is the file of --path")):
                done = subprocess.run([BINARY, "fly", f"http://{flights.UPSTREAM}/jacksboro", "--path", path, option, file], capture_output=True,
                                      text=True, timeout=60, check=False)
                self.assertEqual((done.returncode, done.stdout), (code, ""))
                self.assertIn(f"terrace: {part.format(file)}", done.stderr)
            self.assertTrue(path.read_text().startswith("-84.3"))

    def test_says_why_there_is_no_document(self):
        for path, part in (("nothing", "/nothing/layer.json: status 404: no such dataset; /datasets lists them"),
                           ("jacksboro?error=bad", "/jacksboro/layer.json?error=bad: status 400: error must be a finite number above 0")):
            status, report = fly(flights.UPSTREAM, path=path)
            self.assertEqual((status, report["summary"]["retries"]), (1, 0))
            self.assertIn(part, " ".join(report["summary"]["findings"]))

    def test_says_how_to_send_a_token(self):
        with tempfile.TemporaryDirectory() as folder:
            token = "a token of at least 32 characters"
            with Configured(folder, {"datasets": [{"name": "jacksboro", "sources": [str(DEM)]}],
                                     "tokens": [{"name": "pilot", "sha256": hashlib.sha256(token.encode()).hexdigest(), "datasets": ["jacksboro"]}]}) as server:
                url = f"http://127.0.0.1:{server.port}/jacksboro"
                status, summary = fly_to(url)
                self.assertEqual(status, 1)
                self.assertRegex(" ".join(summary["findings"]), r'status 401: a token is needed: .*; send a token with --header "Authorization: Bearer')
                self.assertEqual(fly_to(url, "--header", f"Authorization: Bearer {token}")[0], 0)

    @unittest.skipUnless(shutil.which("openssl"), "needs openssl")
    def test_loads_the_view_by_https_if_it_trusts_the_server(self):
        with tempfile.TemporaryDirectory() as folder:
            certificate, key = pathlib.Path(folder, "tls.crt"), pathlib.Path(folder, "tls.key")
            subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                            "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", key, "-out", certificate],
                           check=True, stderr=subprocess.DEVNULL)
            with Configured(folder, {"tls": {"certificate": str(certificate), "key": str(key)},
                                     "datasets": [{"name": "jacksboro", "sources": [str(DEM)]}]}) as server:
                url = f"https://localhost:{server.port}/jacksboro"
                trusted = {"SSL_CERT_FILE": str(certificate)}
                for tiles in ("terrain", "3dtiles"):
                    status, summary = fly_to(url, "--format", tiles, "--forbid-holes", "--require", "full-view=60s,errors=0,refusals=0,holes=0",
                                             environment=trusted)
                    self.assertEqual(status, 0, summary)
                    self.assertGreater(summary["tiles"], 60)
                    self.assertLessEqual(summary["connections"], 20)
                # Not trusted, or another name than the certificate's: nothing is loaded, and nothing is tried again.
                for wrong, environment in ((url, {"SSL_CERT_FILE": "/dev/null"}), (url.replace("localhost", "127.0.0.1"), trusted)):
                    status, answer = fly_to(wrong, environment=environment)
                    self.assertEqual(status, 1, answer)
                    self.assertIn("certificate verify failed", str(answer))
                    self.assertIn("SSL_CERT_FILE", str(answer))
                    self.assertEqual(answer["outcomes"]["no_connection"], 1, "asking again does not help")
                status, summary = fly_to(url.replace("localhost", "127.0.0.1"), "--insecure", "--require", "full-view=60s,errors=0")
                self.assertEqual(status, 0, summary)

    def test_has_no_hole_around_deeper_levels(self):
        """Around `precision` there are levels below those of the sources, and nowhere else."""
        with tempfile.TemporaryDirectory() as folder:
            box = [[-84.2505, 36.2995], [-84.2495, 36.2995], [-84.2495, 36.3005], [-84.2505, 36.3005], [-84.2505, 36.2995]]
            edits = {"type": "FeatureCollection", "features": [
                {"type": "Feature", "properties": {"terrain": {"op": "precision", "error_m": 0.5, "blend_m": 50}},
                 "geometry": {"type": "Polygon", "coordinates": [box]}}]}
            pathlib.Path(folder, "edits.geojson").write_text(json.dumps(edits), encoding="utf-8")
            with Configured(folder, {"datasets": [{"name": "jacksboro", "sources": [str(DEM)], "edits": ["edits.geojson"]},
                                                  {"name": "plain", "sources": [str(DEM)]}]}) as server:
                def levels(name):
                    with urllib.request.urlopen(f"http://127.0.0.1:{server.port}/{name}/layer.json", timeout=60) as reply:
                        return len(json.load(reply)["available"])
                self.assertGreater(levels("jacksboro"), levels("plain") + 2)
                for tiles in ("terrain", "3dtiles"):
                    urls = pathlib.Path(folder, "urls-" + tiles)
                    status, summary = fly_to(f"http://127.0.0.1:{server.port}/jacksboro", "--format", tiles, "--forbid-holes", "--urls", urls,
                                             "--require", "full-view=60s,errors=0,refusals=0,holes=0",
                                             way=["--circle", "-84.25,36.30,700,250", "--speed", "100"])
                    self.assertEqual(status, 0, summary)
                    self.assertGreater(summary["holes"]["examined_frames"], 3)
                    # /jacksboro/LEVEL/X/Y.terrain, /jacksboro/3dtiles/LEVEL-X-Y/LEVEL_BELOW/X/Y.glb
                    found = re.findall(r"^/jacksboro/(?:3dtiles/(\d+)-\d+-\d+/)?(\d+)/\d+/\d+\.(?:terrain|glb)", urls.read_text(), re.M)
                    asked = [int(root or 0) + int(level) for root, level in found]
                    self.assertGreaterEqual(max(asked), levels("plain") + 1, tiles)


class Faults(unittest.TestCase):
    def test_waits_as_long_as_a_busy_server_says(self):
        refused, pauses = {}, []

        def refuse_twelve(handler, number):
            if number <= 12:
                refused[handler.path] = time.monotonic()
                return fault_proxy.refuse(handler, "2")
            if handler.path in refused:
                pauses.append(time.monotonic() - refused.pop(handler.path))
            return False

        status, summary = fly_with_fault(refuse_twelve)
        self.assertEqual(status, 0)
        self.assertEqual(summary["outcomes"]["refused"], 12)
        self.assertEqual(summary["retries"], 12)
        self.assertEqual(summary["clients_without_full_view"], 0)
        self.assertEqual(len(refused) + len(pauses), 12)
        self.assertGreaterEqual(len(pauses), 8)  # all were asked again but those that the view did not need any more
        self.assertGreaterEqual(min(pauses), 2)  # and none sooner than it may be
        self.assertGreaterEqual(summary["latency_s"]["max"], 2, "a latency counts from the first request")

    def test_asks_a_busy_document_again(self):
        asked = []

        def busy(path, status, headers, body):
            if path.endswith("layer.json"):
                asked.append(path)
                if len(asked) <= 2:
                    return 503, {"Retry-After": "0"}, b""
            return status, headers, body

        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=busy) as proxy:
            status, report = fly(proxy.address)
        self.assertEqual(status, 0)
        self.assertEqual(report["summary"]["outcomes"]["refused"], 2)
        self.assertEqual(report["summary"]["retries"], 2)

    def test_counts_no_refusals_among_the_attempts(self):
        asked = {"layer.json": 0, "0/0/0.terrain": 0}

        def refuse_six_and_fail_once(path, status, headers, body):
            for name in asked:
                if path.split("?")[0].endswith(name):
                    asked[name] += 1
                    if asked[name] <= 6:
                        return 503, {"Retry-After": "0"}, b""
                    if asked[name] == 7:
                        return 500 if name == "layer.json" else 200, {"Retry-After": "0"}, b"damaged"
            return status, headers, body

        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=refuse_six_and_fail_once) as proxy:
            status, report = fly(proxy.address)
        summary = report["summary"]
        self.assertEqual(status, 0, summary)
        self.assertEqual((summary["outcomes"]["refused"], summary["outcomes"]["other_status"], summary["outcomes"]["damaged"]), (12, 1, 1))
        self.assertEqual(summary["retries"], 14)
        self.assertEqual(asked, {"layer.json": 8, "0/0/0.terrain": 8})

    def test_repeats_what_a_problem_document_says(self):
        def answer(status, body):
            return lambda path, *_: (status, {"Content-Type": "application/problem+json"}, body)

        for status, body, part in ((403, b'{"detail":"not yours"}', "status 403: not yours"), (418, b'{"detail":7}', "status 418"),
                                   (418, b"[1]", "status 418"), (418, b'{"detail":"\\u001b[2J"}', "status 418"), (418, b"<html>", "status 418"),
                                   (403, gzip.compress(b'{"detail":"not yours"}'), "status 403: not yours"),
                                   (403, b"\x1f\x8b no gzip", "status 403")):
            with self.subTest(body=body), fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=answer(status, body)) as proxy:
                code, report = fly(proxy.address)
                self.assertEqual(code, 1)
                self.assertEqual(report["summary"]["messages"], {"document: " + part: 1})

    @in_parallel.alone
    def test_counts_faults_and_flies_on(self):
        def every(period, fault):
            return lambda handler, number: number % period == 0 and fault(handler)

        cases = {
            "not_found": (fault_proxy.not_found, False),
            "damaged": (fault_proxy.garbage_body, True),
            "no_http": (fault_proxy.no_http, True),
            "cut": (fault_proxy.cut, True),
            "timeout": (fault_proxy.silence, True),
        }
        results = {}

        def run(name, fault):
            options = ["--timeout", "1"] if name == "timeout" else []
            results[name] = fly_with_fault(every(7, fault), *options, "--first-view-limit", "4")

        threads = [threading.Thread(target=run, args=(name, fault)) for name, (fault, _) in cases.items()]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for name, (_, asks_again) in cases.items():
            with self.subTest(fault=name):
                status, summary = results[name]
                self.assertEqual(status, 0, summary)
                self.assertGreater(summary["outcomes"][name], 3)
                self.assertGreater(summary["tiles"], 40)
                self.assertEqual(summary["retries"] > 0, asks_again)
                self.assertTrue(any(finding for finding in summary["findings"]), summary["findings"])

    def test_ends_where_nothing_answers(self):
        cases = {"silent": fault_proxy.silence, "closes": fault_proxy.close_at_once}
        for name, fault in cases.items():
            with self.subTest(name):
                status, summary = fly_with_fault(lambda handler, number, fault=fault: fault(handler), "--timeout", "0.5", "--first-view-limit", "2",
                                                 duration="1")
                self.assertEqual(status, 1)
                self.assertEqual(summary["tiles"], 0)
                self.assertEqual(summary["clients_without_full_view"], 1)

    def test_ends_where_nothing_listens(self):
        status, report = fly("127.0.0.1:1", "--first-view-limit", "2")
        self.assertEqual(status, 1)
        self.assertGreater(report["summary"]["outcomes"]["no_connection"], 0)
        self.assertGreaterEqual(report["summary"]["retries"], report["summary"]["outcomes"]["no_connection"] - 1)
        self.assertEqual(report["summary"]["clients_without_document"], 1)

    def test_refuses_a_document_that_is_none(self):
        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=lambda path, status, headers, body: (200, {}, b"<html>welcome</html>")) as proxy:
            status, report = fly(proxy.address)
        self.assertEqual(status, 1)
        self.assertIn("layer.json cannot be read", " ".join(report["summary"]["findings"]))

    @staticmethod
    def fly_over_a_change(edit=None, is_gone=False, tiles=60, after_s=0, **more):
        """(exit status, summary) of a flight during which the version becomes 0123456789ab: after some tiles and seconds.
        `edit(document)` may change both versions of layer.json. `is_gone`: URLs of the old version are not found."""
        changed, start = threading.Event(), time.monotonic()

        def newer(path, status, headers, body):
            if path.split("?")[0].endswith("layer.json"):
                headers.pop("Content-Encoding", None)
                document = json.loads(urllib.request.urlopen(f"http://{flights.UPSTREAM}/jacksboro/layer.json", timeout=60).read())
                if changed.is_set():
                    document["tiles"] = [document["tiles"][0].replace(document["version"], "0123456789ab")]
                    document["version"] = "0123456789ab"
                if edit:
                    edit(document)
                return status, headers, json.dumps(document).encode()
            is_old = changed.is_set() and "v=0123456789ab" not in path
            if is_old and is_gone and fault_proxy.TILE.search(path):
                return 404, {}, b""
            return status, {**headers, "Cache-Control": "no-store" if is_old else "public, max-age=31536000, immutable"}, body

        def change(handler, number):
            if number >= tiles and time.monotonic() - start >= after_s:
                changed.set()
            return False

        with fault_proxy.FaultProxy(flights.UPSTREAM, change, newer) as proxy:
            status, report = fly(proxy.address, **more)
        return status, report["summary"]

    def test_takes_a_new_version_in_flight(self):
        status, summary = self.fly_over_a_change(duration="4")
        self.assertEqual(status, 0, summary)
        self.assertEqual(summary["version_changes"], 1)
        self.assertGreater(summary["mixed_version_frames"], 0)
        self.assertIn("changed its version", " ".join(summary["findings"]))
        self.assertGreaterEqual(summary["tiles"], 100)  # old ones, and all of them again

    def test_fills_the_holes_of_a_version_that_is_gone(self):
        rest = ["--from", "-84.25,36.3,1500", "--to", "-84.25,36.3,1500"]
        # At rest all tiles fail before the document may be read again. Later new tiles fail, and the document is read at once.
        for more in ({"tiles": 20, "way": rest, "duration": "3"}, {"after_s": 3, "duration": "5"}):
            with self.subTest(**more):
                status, summary = self.fly_over_a_change(is_gone=True, **more)
                self.assertEqual((status, summary["version_changes"]), (0, 1), summary)
                self.assertGreater(summary["outcomes"]["not_found"], 0)
                self.assertEqual(summary["failed_tiles"], 0, "they are asked for again")
                self.assertIsNotNone(summary["arrival_full_view_s"])

    def test_shows_one_version_when_all_tiles_are_replaced(self):
        def remove_a_column(document):  # below the camera: the client makes these tiles from their parents
            (block,) = document["available"][12]
            document["available"][12] = [{**block, "endX": 2177}, {**block, "startX": 2179}]

        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "path.csv")  # rests for ten of its fourteen seconds
            path.write_text("0,-84.27,36.2,3000,0,-20\n4,-84.27,36.3,3000,0,-20\n14,-84.27,36.3,3000,0,-20\n")
            status, summary = self.fly_over_a_change(remove_a_column, way=["--path", path], duration="14")
        self.assertEqual((status, summary["version_changes"]), (0, 1), summary)
        self.assertLess(summary["mixed_version_frames"], summary["frames"] / 2)

    def test_keeps_tiles_whose_new_url_is_none(self):
        def break_url(document):
            if document["version"] == "0123456789ab":
                document["tiles"] = ["http://[::1/" + document["tiles"][0]]

        status, summary = self.fly_over_a_change(break_url, duration="4")
        self.assertEqual((status, summary["version_changes"]), (0, 1), summary)
        counts = {count for text, count in summary["messages"].items() if text.startswith("http://[::1/")}
        self.assertEqual(counts, {1}, "each tile is tried once")

    @in_parallel.alone
    def test_says_that_a_slow_server_does_not_keep_up(self):
        with fault_proxy.FaultProxy(flights.UPSTREAM, tiles_per_second=10) as proxy:
            status, report = fly(proxy.address, "--require", "full-view=2s,p99=500ms,refined=90%", "--first-view-limit", "3", duration="3")
        summary = report["summary"]
        self.assertEqual(status, 1)
        self.assertEqual([requirement["holds"] for requirement in report["requirements"]], [False, False, False])
        self.assertIn("does not keep up", " ".join(summary["findings"]))
        self.assertLessEqual(summary["best_tiles_per_second"], 12)


if __name__ == "__main__":
    flights.main()
