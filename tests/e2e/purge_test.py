"""The operators' address of the real binary: purge_test.py BINARY SOURCE_DIR.

A purge erases the chosen tiles from memory and disk while many clients load: none sees an error, and what is built again is
what was chosen.
"""
import http.client
import json
import math
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
CLIENTS = 64


class Server:
    def __init__(self, config, folder):
        path = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "terrace.json"
        path.write_text(json.dumps({"listen": "127.0.0.1:0", **config}))
        self.log_path = path.with_name("log")
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen([BINARY, "serve", "--config", path], stdout=subprocess.PIPE, stderr=log, text=True)
        match = re.search(r"http://127\.0\.0\.1:(\d+)", self.process.stdout.readline())
        if not match:
            raise RuntimeError(f"did not start: {self.log_path.read_text()}")
        self.port = int(match.group(1))
        operators = re.search(r"operators: http://127\.0\.0\.1:(\d+)/", self.log())
        self.admin_port = operators and int(operators.group(1))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.status = self.process.wait(timeout=60)
        self.process.stdout.close()

    def log(self):
        return self.log_path.read_text()

    def ask(self, port, method, target, headers={}, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request(method, target, body, headers)
        reply = connection.getresponse()
        body = reply.read()
        connection.close()
        return reply.status, reply.headers, body

    def get(self, target):
        return self.ask(self.port, "GET", target)

    def purge(self, query):
        status, headers, body = self.ask(self.admin_port, "POST", "/admin/purge?" + query)
        assert status == 200, (query, status, body)
        assert headers["Cache-Control"].endswith("no-store"), headers["Cache-Control"]
        return json.loads(body)["erased"]

    def builds(self, dataset="alps"):
        time.sleep(1.1)  # a text of /metrics is a second old at most
        text = self.ask(self.admin_port, "GET", "/metrics")[2].decode()
        return sum(int(float(count)) for count in
                   re.findall(rf'terrace_tile_builds_total\{{dataset="{dataset}",result="ok"\}} (\S+)', text))


class Purge(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        for name in ("N46E007", "N47E008"):
            write_hgt(cls.folder / f"{name}.hgt", phase=len(name))
        cls.config = {"admin_listen": "127.0.0.1:0", "access_log": "off",
                      "datasets": [{"name": name, "sources": [str(cls.folder / file)]}
                                   for name, file in (("alps", "N46E007.hgt"), ("other", "N47E008.hgt"))]}

    def tiles(self, server):
        """(level, west, south, east, north, target) of tiles of each format; levels and bounds of their own scheme."""
        layer = json.loads(server.get("/alps/layer.json")[2])
        for z in range(7, 11):
            for span in layer["available"][z]:
                for x in range(span["startX"], span["endX"] + 1):
                    for y in range(span["startY"], span["endY"] + 1):
                        side = 180 / 2 ** z
                        box = (x * side - 180, y * side - 90, (x + 1) * side - 180, (y + 1) * side - 90)
                        yield z, *box, f"/alps/{z}/{x}/{y}.terrain"
                        if z < 10:
                            yield z, *box, f"/alps/{z}/{x}/{y}.glb"
        latitude = lambda share: math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * share))))
        for z, x, y in ((z, x, y) for z in (8, 9) for x in range(2 ** z) for y in range(2 ** z // 4, 2 ** z // 2)):
            box = (360 * x / 2 ** z - 180, latitude((y + 1) / 2 ** z), 360 * (x + 1) / 2 ** z - 180, latitude(y / 2 ** z))
            if box[0] < 7.9 and box[2] > 7.1 and box[1] < 46.9 and box[3] > 46.1:
                yield z, *box, f"/alps/{z}/{x}/{y}.png"

    def test_a_purge_while_many_clients_load(self):
        with Server({**self.config, "disk_cache": {"directory": str(self.folder / "tiles")}}, self.folder) as server:
            tiles = list(self.tiles(server))
            targets = [tile[-1] for tile in tiles]
            first = {target: server.get(target) for target in targets}
            self.assertEqual({reply[0] for reply in first.values()}, {200})
            server.get("/other/8/268/195.terrain")
            self.assertEqual(server.builds(), len(targets))

            wrongs, rounds, stop = [], [0] * CLIENTS, threading.Event()

            def load(client):
                try:
                    load_until_stopped(client)
                except (OSError, http.client.HTTPException) as error:  # else a_round would wait for ever
                    wrongs.append(error)

            def load_until_stopped(client):
                connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
                while not stop.is_set():
                    for i in range(len(targets)):
                        target = targets[(i + 7 * client) % len(targets)]
                        connection.request("GET", target)
                        reply = connection.getresponse()
                        if (reply.read(), reply.status) != (first[target][2], 200):
                            wrongs.append((target, reply.status))
                    rounds[client] += 1
                connection.close()

            def a_round():
                before = list(rounds)
                while any(now < then + 2 for now, then in zip(rounds, before)) and not wrongs:
                    time.sleep(0.05)

            clients = [threading.Thread(target=load, args=(i,)) for i in range(CLIENTS)]
            for client in clients:
                client.start()
            try:
                a_round()
                self.assertEqual(server.builds(), len(targets), "all are cached")
                west, south, east, north = 7.3, 46.2, 7.6, 46.5
                chosen = [target for z, w, s, e, n, target in tiles
                          if 8 <= z <= 9 and w < east and e > west and s < north and n > south]
                erased = server.purge(f"dataset=alps&bbox={west},{south},{east},{north}&levels=8-9")
                a_round()
                self.assertEqual(server.builds(), len(targets) + len(chosen), "built again: what was chosen")
                self.assertEqual(erased["tiles"], {"memory": len(chosen), "archive": 0, "disk": len(chosen)})
                server.purge("dataset=alps")
                a_round()
                self.assertEqual(server.builds(), 2 * len(targets) + len(chosen), "built again: all")
            finally:
                stop.set()
                for client in clients:
                    client.join()
            self.assertEqual(wrongs, [])
            self.assertEqual(server.builds("other"), 1)
            self.assertEqual(server.get("/other/8/268/195.terrain")[0], 200)
            self.assertEqual(server.builds("other"), 1, "another dataset stays")
            print(f"{CLIENTS} clients, {sum(rounds) * len(targets)} replies, {len(targets)} tiles, {len(chosen)} in the box")

    def test_a_purge_holds_after_a_restart(self):
        config = {**self.config, "disk_cache": {"directory": str(self.folder / "again")}}
        target = "/alps/9/532/388.terrain"
        with Server(config, self.folder) as server:
            server.get(target)
        with Server(config, self.folder) as server:
            server.get(target)
            self.assertEqual(server.builds(), 0, "from disk")
            self.assertEqual(server.purge("dataset=alps&levels=9"),
                             {"tiles": {"memory": 1, "archive": 0, "disk": 1}, "refinements": {"memory": 0, "disk": 1}})
        with Server(config, self.folder) as server:
            server.get(target)
            self.assertEqual(server.builds(), 1)

    def test_what_is_refused(self):
        with Server(self.config, self.folder) as server:
            ask = lambda method, target, **more: server.ask(server.admin_port, method, target, **more)
            for query, status, why in (
                    ("", 400, "dataset is missing"), ("dataset=mars", 404, "no such dataset"),
                    ("dataset=alps&dataset=alps", 400, "more than once"), ("dataset=alps&box=1", 400, "unknown parameter"),
                    ("dataset=alps&v=1", 400, "unknown parameter"),
                    ("dataset=alps&levels=9-8", 400, "levels must"), ("dataset=alps&levels=25", 400, "levels must"),
                    ("dataset=alps&levels=a", 400, "levels must"), ("dataset=alps&bbox=1,2,3", 400, "bbox must"),
                    ("dataset=alps&bbox=7,46,7,47", 400, "bbox is empty"), ("dataset=alps&bbox=7,47,8,46", 400, "south must")):
                got, _, body = ask("POST", "/admin/purge?" + query)
                self.assertEqual(got, status, query)
                self.assertIn(why, json.loads(body)["detail"], query)
            self.assertEqual(ask("GET", "/admin/purge?dataset=alps")[0], 405)
            self.assertEqual(ask("POST", "/metrics")[0], 405)
            self.assertEqual(ask("GET", "/alps/layer.json")[0], 404, "no tiles here")
            got, _, body = ask("POST", "/admin/purge", body=b"dataset=alps")
            self.assertEqual(got, 413)
            self.assertIn("/admin/purge?dataset=NAME", json.loads(body)["detail"])
            status, headers, _ = ask("POST", "/admin/purge?dataset=alps", headers={"Origin": "https://a.example"})
            self.assertEqual((status, headers["Access-Control-Allow-Origin"]), (403, None), "a web page")
            self.assertEqual(server.ask(server.port, "POST", "/admin/purge?dataset=alps")[0], 405, "nothing for the public")
            self.assertEqual(server.get("/admin/purge?dataset=alps")[0], 404)
        self.assertEqual(server.status, 0)

    def test_it_is_off_by_default_and_says_what_is_in_its_way(self):
        config = {key: value for key, value in self.config.items() if key != "admin_listen"}
        with Server(config, self.folder) as server:
            self.assertIsNone(server.admin_port)
            taken = f"127.0.0.1:{server.port}"
            done = subprocess.run([BINARY, "serve", "--listen", "127.0.0.1:0", "--admin-listen", taken, self.folder / "N46E007.hgt"],
                                  stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, timeout=60)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, rf"admin_listen: cannot listen on {taken}: .*choose another port")

    def test_the_address_may_be_a_path(self):
        path = self.folder / "admin.sock"
        for mode in ("0600", "0660"):
            stale = socket.socket(socket.AF_UNIX)
            stale.bind(str(path))
            stale.close()  # as a process that was killed leaves it
            with Server({**self.config, "admin_listen": f"unix:{path}", "admin_socket_mode": mode, "access_log": "combined"}, self.folder) as server:
                self.assertIn(f"operators: unix:{path} answers", server.log())
                self.assertEqual(oct(path.stat().st_mode & 0o777), oct(int(mode, 8)))
                self.assertEqual(server.get("/alps/7/133/97.terrain")[0], 200)

                def ask(method, target):
                    done = subprocess.run(["curl", "-s", "-i", "--unix-socket", path, "-X", method, "http://localhost" + target], check=True,
                                          stdout=subprocess.PIPE, text=True)
                    head, _, body = done.stdout.partition("\n\n" if "\r" not in done.stdout else "\r\n\r\n")
                    return int(head.split()[1]), body
                self.assertEqual(json.loads(ask("POST", "/admin/purge?dataset=alps")[1])["erased"]["tiles"]["memory"], 1)
                self.assertIn("terrace_http_requests_total", ask("GET", "/metrics")[1])
                self.assertEqual(ask("GET", "/alps/layer.json")[0], 404)
                taken = subprocess.run([BINARY, "serve", "--listen", "127.0.0.1:0", "--admin-listen", f"unix:{path}", self.folder / "N46E007.hgt"],
                                       stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, timeout=60)
                self.assertEqual(taken.returncode, 1)
                self.assertRegex(taken.stderr, rf"admin_listen: cannot listen on unix:{path}: another process listens there")
                self.assertEqual(ask("GET", "/version")[0], 200, "the socket of the other process still stands")
            self.assertEqual(server.status, 0)
            self.assertFalse(path.exists(), "removed at the end")
        path.write_text("something else")
        done = subprocess.run([BINARY, "serve", "--listen", "127.0.0.1:0", "--admin-listen", f"unix:{path}", self.folder / "N46E007.hgt"],
                              stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("something else lies there", done.stderr)
        self.assertEqual(path.read_text(), "something else")


if __name__ == "__main__":
    unittest.main()
