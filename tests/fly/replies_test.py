"""What terrace fly makes of replies and of their absence, over a server of the sample: replies_test.py BINARY SOURCE_DIR."""
import contextlib
import email.utils
import json
import re
import signal
import socket
import subprocess
import threading
import time
import unittest
import urllib.request
import zlib

import fault_proxy
import flights
import in_parallel  # flights has set the path
from flights import BINARY, WAY, fly, fly_to, fly_with_fault

REST = ["--from", "-84.25,36.3,1500", "--to", "-84.25,36.3,1500"]


class Requests(unittest.TestCase):
    @in_parallel.alone
    def test_each_one_without_an_answer_is_a_timeout(self):
        begun = []

        def ignore_every_fifth(handler, number):
            if number % 5 == 0:
                begun.append(time.monotonic())
                return fault_proxy.silence(handler)
            return False

        status, summary = fly_with_fault(ignore_every_fifth, "--timeout", "3", "--first-view-limit", "4",
                                         way=["--circle", "-84.25,36.3,1500,8000"], duration="5")
        end = time.monotonic()
        self.assertEqual(status, 0, summary)
        self.assertGreater(summary["outcomes"]["timeout"], 3)
        self.assertGreaterEqual(summary["outcomes"]["timeout"], sum(at < end - 6 for at in begun))
        self.assertLessEqual(summary["outcomes"]["timeout"], len(begun), "none is sent again without a trace")
        self.assertEqual(summary["outcomes"]["cut"], 0)

    @in_parallel.alone
    def test_that_are_never_answered_are_slow(self):
        with fault_proxy.FaultProxy(flights.UPSTREAM, lambda handler, number: number % 4 == 0 and fault_proxy.silence(handler)) as proxy:
            status, report = fly(proxy.address, "--first-view-limit", "1", "--require", "errors=0,p99=1s", duration="1")
        summary = report["summary"]
        self.assertEqual(status, 1, summary)
        self.assertEqual([requirement["holds"] for requirement in report["requirements"]], [True, False])
        self.assertGreater(summary["open_tiles"], 5)
        self.assertIn("had not arrived at the end", " ".join(summary["findings"]))

    def test_have_all_headers(self):
        seen = {}

        def note(handler, number):
            if number == 1:
                seen.update({name: handler.headers.get_all(name) for name in ("X-A", "User-Agent", "Authorization", "Host")})
            return False

        options = [part for text in ("X-A: 1", "x-a:2 ", "User-Agent: me", "Authorization:\tBearer t") for part in ("--header", text)]
        self.assertEqual(fly_with_fault(note, *options)[0], 0)
        host = seen.pop("Host")
        self.assertEqual(seen, {"X-A": ["1", "2"], "User-Agent": ["me"], "Authorization": ["Bearer t"]})
        self.assertRegex(host[0], r"^127\.0\.0\.1:\d+$")


    def test_have_no_headers_for_other_servers(self):
        seen = {}

        def note(handler, number):
            seen.setdefault(handler.headers["Host"], set()).add(handler.headers["Authorization"])
            return False

        def name_tiles_elsewhere(path, status, headers, body):
            if path.split("?")[0].endswith("layer.json"):
                document = json.loads(body)
                document["tiles"] = [f"http://{elsewhere.address}/jacksboro/" + template for template in document["tiles"]]
                body = json.dumps(document).encode()
            return status, headers, body

        options = ["--header", "Authorization: Bearer t", "--header", "Accept-Encoding: identity"]
        with fault_proxy.FaultProxy(flights.UPSTREAM, note) as elsewhere, \
                fault_proxy.FaultProxy(flights.UPSTREAM, note, name_tiles_elsewhere) as proxy:
            for first, token in ((proxy, None), (elsewhere, "Bearer t")):
                self.assertEqual(fly(first.address, *options, way=REST)[0], 0)
                self.assertEqual(seen.pop(elsewhere.address), {token})


    def test_of_tiles_have_the_parameters_of_the_document(self):
        queries = set()

        def note(handler, number):
            queries.add(handler.path.split("?")[1])
            return False

        with fault_proxy.FaultProxy(flights.UPSTREAM, note) as proxy:
            self.assertEqual(fly(proxy.address, path="jacksboro?error=5&extensions=octvertexnormals", way=REST)[0], 0)
        (query,) = queries
        self.assertEqual(sorted(re.findall(r"(?:error|extensions)=\w+", query)), ["error=5", "extensions=octvertexnormals"])


class TilesThatFail(unittest.TestCase):
    def test_leave_no_full_view_and_do_not_hold_up_the_flight(self):
        def lose_a_third(path, status, headers, body):
            if fault_proxy.TILE.search(path) and zlib.crc32(path.split("?")[0].encode()) % 3 == 0:
                return 404, {}, b""
            return status, headers, body

        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=lose_a_third) as proxy:
            status, report = fly(proxy.address, "--first-view-limit", "600", "--require", "full-view=600s,refined=1%,p99=600s", way=REST)
        summary = report["summary"]
        self.assertEqual(status, 1)
        self.assertGreater(summary["tiles"], 40)
        self.assertGreater(summary["flying_frames"], 10)
        self.assertEqual((summary["refined_share"], summary["first_full_view_s"]["worst"], summary["arrival_full_view_s"]), (0, None, None))
        self.assertEqual(summary["clients_without_full_view"], 1)
        self.assertNotIn("keep up", " ".join(summary["findings"]), "it answers at once")
        self.assertEqual([requirement["holds"] for requirement in report["requirements"]], [False, False, False])
        self.assertIsNone(summary["latency_s"]["p99"], "a third never arrives")
        self.assertGreater(summary["failed_tiles"], 10)

    def test_leave_holes_in_the_tiles_made_of_them(self):
        def lose_a_parent(path, status, headers, body):
            if path.split("?")[0].endswith("layer.json"):
                with urllib.request.urlopen(f"http://{flights.UPSTREAM}/jacksboro/layer.json", timeout=60) as reply:
                    document = json.load(reply)
                (block,) = document["available"][13]
                document["available"][13] = [{**block, "startX": 4351}]  # below the camera the client makes 13/4350/5748 from 12/2175/2874
                return 200, {}, json.dumps(document).encode()
            return (404, {}, b"") if is_lost and path.startswith("/jacksboro/12/2175/2874.") else (status, headers, body)

        place = "-84.40796,36.30981,2000"
        way = ["--from", place, "--to", place, "--pitch", "-90", "--fov", "30"]
        for is_lost in (False, True):
            with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=lose_a_parent) as proxy:
                _, report = fly(proxy.address, way=way)
            holes = report["summary"]["holes"]
            self.assertGreater(holes["examined_frames"], 3)
            self.assertEqual(holes["frames"], holes["examined_frames"] if is_lost else 0, report["summary"])


class Replies(unittest.TestCase):
    def test_may_name_the_time_of_the_next_request(self):
        refused, pauses = {}, []

        def refuse_twelve(handler, number):
            if number <= 12:
                refused[handler.path] = time.monotonic()
                return fault_proxy.refuse(handler, email.utils.formatdate(time.time() + 4, usegmt=True))
            if handler.path in refused:
                pauses.append(time.monotonic() - refused.pop(handler.path))
            return False

        status, summary = fly_with_fault(refuse_twelve, way=REST, duration="1")
        self.assertEqual((status, summary["outcomes"]["refused"]), (0, 12))
        self.assertGreaterEqual(len(pauses), 8, "all but those that the view did not need any more")
        self.assertGreaterEqual(min(pauses), 3)  # in whole seconds, a 4 can be a 3

    def test_are_not_what_follows_another_one(self):
        def answer_twice(handler, number):
            if number % 5 == 0:
                handler.wfile.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\nHTTP/1.1 418 No\r\nContent-Length: 0\r\n\r\n")
            return number % 5 == 0

        _, summary = fly_with_fault(answer_twice, way=REST)
        self.assertGreater(summary["outcomes"]["not_found"], 3)
        self.assertEqual(summary["outcomes"]["other_status"], 0)

    def test_come_from_the_address_that_answers(self):
        with fault_proxy.FaultProxy(flights.UPSTREAM) as proxy, socket.socket(socket.AF_INET6) as silent:
            port = int(proxy.address.split(":")[1])
            try:
                silent.bind(("::1", port))
                families = [place[0] for place in socket.getaddrinfo("localhost", port, type=socket.SOCK_STREAM, flags=socket.AI_ADDRCONFIG)]
            except OSError:
                families = []
            if families != [socket.AF_INET6, socket.AF_INET]:
                self.skipTest("SKIPPED: localhost is not ::1, then 127.0.0.1")
            silent.listen(0)
            with contextlib.ExitStack() as stack:
                for _ in range(2):  # the queue of connections is full: the kernel does not answer others
                    waiting = stack.enter_context(socket.socket(socket.AF_INET6))
                    waiting.setblocking(False)
                    waiting.connect_ex(("::1", port))
                status, report = fly(f"localhost:{port}", "--timeout", "4", "--loads", "2", "--require", "errors=0", way=REST)
        self.assertEqual(status, 0, report)

    def test_may_follow_informational_ones(self):
        def hint(handler, number):
            if number % 2 == 0:
                handler.wfile.write(b"HTTP/1.1 103 Early Hints\r\nLink: </x>\r\n\r\n" * (number % 3 + 1))
            return False

        status, summary = fly_with_fault(hint, "--require", "errors=0,full-view=60s")
        self.assertEqual(status, 0, summary)
        self.assertGreater(summary["tiles"], 60)

    def test_that_redirect_a_document_name_its_url(self):
        def move(path, status, headers, body):
            return 301, {"Location": "/elsewhere/layer.json?error=5&token=0123456789abcdef"}, b""

        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=move) as proxy:
            status, report = fly(proxy.address)
            self.assertEqual(status, 1)
            self.assertEqual(report["summary"]["messages"],
                             {f"document: status 301; it moved to http://{proxy.address}/elsewhere/layer.json?error=5&token=...; give this URL": 1})
            self.assertNotIn("0123456789abcdef", json.dumps(report))

    def test_that_redirect_tiles_are_followed(self):
        seen = set()

        def note(handler, number):
            seen.add(handler.headers["Authorization"])
            return False

        def move(path, status, headers, body):  # each tile four times on this server, then to the other one
            if not fault_proxy.TILE.search(path):
                return status, headers, body
            hops = path.count("hop=")
            return 302, {"Location": f"{path}&hop={hops}" if hops < 4 else f"http://{elsewhere.address}{path.split('&hop')[0]}"}, b""

        with fault_proxy.FaultProxy(flights.UPSTREAM, note) as elsewhere, fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=move) as proxy:
            status, report = fly(proxy.address, "--header", "Authorization: Bearer t", "--require", "errors=0,full-view=60s", way=REST)
        self.assertEqual((status, seen), (0, {None}), report["summary"])

    def test_that_redirect_tiles_without_end_fail(self):
        with fault_proxy.FaultProxy(flights.UPSTREAM, rewrite=lambda path, status, headers, body: (
                (307, {"Location": path}, b"") if fault_proxy.TILE.search(path) else (status, headers, body))) as proxy:
            status, report = fly(proxy.address, way=REST, duration="1")
        self.assertEqual((status, set(report["summary"]["messages"])), (1, {"tile: status 307; it is redirected more than 5 times"}))

    def test_with_a_tilejson_are_no_document(self):
        status, report = fly(flights.UPSTREAM, path="jacksboro/tiles.json")
        self.assertEqual(status, 1)
        self.assertIn("this is the TileJSON of a map; give the URL of a layer.json or tileset.json", " ".join(report["summary"]["findings"]))

    def test_in_plain_http_to_https_say_so(self):
        status, summary = fly_to(f"https://{flights.UPSTREAM}/jacksboro", "--first-view-limit", "5")
        self.assertEqual(status, 1)
        self.assertIn("if the server speaks plain HTTP on this port, use http://", " ".join(summary["findings"]))


class Interrupted(unittest.TestCase):
    def test_before_the_first_view_has_its_document(self):
        asked = threading.Event()

        def ignore(handler, _):
            asked.set()
            return fault_proxy.silence(handler)

        with fault_proxy.FaultProxy(flights.UPSTREAM, ignore) as proxy:
            process = subprocess.Popen([BINARY, "fly", f"http://{proxy.address}/jacksboro", *WAY, "--json"], stdout=subprocess.PIPE,
                                       stderr=subprocess.DEVNULL, text=True)
            self.assertTrue(asked.wait(60))
            process.send_signal(signal.SIGINT)
            summary = json.loads(process.communicate(timeout=60)[0])["summary"]
        self.assertEqual((summary["clients_without_document"], summary["clients_without_full_view"]), (0, 1))
        self.assertNotIn("did not fly", " ".join(summary["findings"]))


if __name__ == "__main__":
    flights.main()
