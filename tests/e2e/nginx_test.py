"""docker/nginx.conf.template in a real nginx in front of the real binary: nginx_test.py BINARY SOURCE_DIR.

Skipped (exit code 77) without nginx, curl or openssl.
"""
import gzip
import json
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
TEMPLATE = SOURCE_DIR / "docker/nginx.conf.template"
TILE = "/earth/4/9/11.terrain"
TOKEN = "0123456789abcdef"


def two_free_ports():
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
        return one.getsockname()[1], other.getsockname()[1]


def wait_for_port(port):
    for _ in range(1200):
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise RuntimeError(f"nobody listens on port {port}")


class Reply:
    def __init__(self, raw_head, body, version, status):
        lines = raw_head.strip().splitlines()
        self.fields = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
        self.body, self.version, self.status = body, version, status


class Proxied(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.folder.chmod(0o755)  # nginx's workers run as another user
        cls.start_terrace()
        cls.start_nginx()

    @classmethod
    def start_terrace(cls):
        samples = SOURCE_DIR / "config/samples"
        config = {"datasets": [{"name": "earth", "sources": [str(samples / "etopo5.tif")], "public": True},
                               {"name": "secret", "sources": [str(samples / "jacksboro.tif")]}],
                  "tokens": [{"name": "one", "token": TOKEN, "datasets": ["secret"]}],
                  "trusted_proxies": ["127.0.0.1"], "access_log": "json", "access_log_file": "access.log"}
        (cls.folder / "terrace.json").write_text(json.dumps(config))
        cls.terrace = subprocess.Popen([BINARY, "serve", "--config", cls.folder / "terrace.json", "--listen", "127.0.0.1:0"],
                                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        cls.addClassCleanup(cls.stop_terrace)
        cls.terrace_port = int(re.search(r":(\d+)/", cls.terrace.stdout.readline())[1])

    @classmethod
    def stop_terrace(cls):
        cls.terrace.terminate()
        cls.terrace.wait(30)
        cls.terrace.stdout.close()

    @classmethod
    def start_nginx(cls):
        cls.http_port, cls.port = two_free_ports()
        certificates = cls.folder / "certificates"
        certificates.mkdir()
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                        "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", certificates / "tls.key", "-out",
                        certificates / "tls.crt"], check=True, stderr=subprocess.DEVNULL)
        nodes = (SOURCE_DIR / "docker/nodes.conf").read_text().replace("terrace:8080", f"127.0.0.1:{cls.terrace_port}")
        (cls.folder / "nodes.conf").write_text(nodes)
        values = {"TERRACE_NODES": str(cls.folder / "nodes.conf"), "TERRACE_HTTP_PORT": str(cls.http_port),
                  "TERRACE_HTTPS_PORT": str(cls.port), "TERRACE_CERTIFICATES": str(certificates), "TERRACE_CACHE": str(cls.folder / "cache")}
        filled = re.sub(r"\$\{(TERRACE_\w+)\}", lambda match: values[match[1]], TEMPLATE.read_text())
        # The rest of the configuration is like nginx.conf of the image, but in a temporary folder. It has a log of its own.
        paths = "\n".join(f"  {name}_temp_path {cls.folder}/{name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        log = f"log_format main '\"$request\" \"$http_referer\"'; access_log {cls.folder}/image.log main;"
        cls.nginx_conf = cls.folder / "nginx.conf"
        cls.nginx_conf.write_text(f"daemon off; worker_processes 1; pid {cls.folder}/nginx.pid; error_log {cls.folder}/error.log;\n"
                                  f"events {{ worker_connections 256; }}\nhttp {{\n{paths}\n{log}\n{filled}\n}}\n")
        cls.nginx_log = open(cls.folder / "nginx.log", "w+")
        cls.addClassCleanup(cls.nginx_log.close)
        cls.nginx = subprocess.Popen(["nginx", "-e", cls.folder / "error.log", "-c", cls.nginx_conf], stdout=cls.nginx_log,
                                     stderr=subprocess.STDOUT)
        cls.addClassCleanup(cls.stop_nginx)
        wait_for_port(cls.port)

    @classmethod
    def stop_nginx(cls):
        cls.nginx.terminate()
        cls.nginx.wait(30)

    def get(self, target, *options, headers=(), port=None, scheme="https"):
        with tempfile.TemporaryDirectory() as folder:
            head, body = pathlib.Path(folder, "head"), pathlib.Path(folder, "body")
            body.touch()
            out = subprocess.run(
                ["curl", "-sk", "--max-time", "30", "--http2", "-D", head, "-o", body, "-w", "%{http_version} %{http_code}", *options,
                 *(part for header in headers for part in ("-H", header)), f"{scheme}://localhost:{port or self.port}{target}"],
                check=True, stdout=subprocess.PIPE, text=True).stdout.split()
            return Reply(head.read_text(encoding="latin-1"), body.read_bytes(), out[0], int(out[1]))

    def direct(self, target, *headers):
        return self.get(target, headers=headers, port=self.terrace_port, scheme="http")

    def log_lines(self):
        return [json.loads(line) for line in (self.folder / "access.log").read_text().splitlines()]

    def lines_with(self, text):
        """At least one: a line is written after its reply."""
        end = time.monotonic() + 60
        while True:
            lines = [line for line in self.log_lines() if text in json.dumps(line)]
            if lines or time.monotonic() > end:
                return lines
            time.sleep(0.02)

    def test_configuration_is_valid(self):
        check = subprocess.run(["nginx", "-t", "-e", self.folder / "error.log", "-c", self.nginx_conf], stderr=subprocess.PIPE, text=True)
        self.assertEqual(check.returncode, 0, check.stderr)
        self.assertNotIn("[warn]", check.stderr)

    def test_no_log_of_nginx_has_a_token(self):
        self.get(f"/secret/layer.json?token={TOKEN}", headers=[f"Referer: https://localhost/?token={TOKEN}"])
        self.get(f"/secret/layer.json?token={TOKEN}", port=self.http_port, scheme="http")
        for log in ("nginx.log", "image.log", "error.log"):
            self.assertNotIn(TOKEN, (self.folder / log).read_text(), log)

    def test_connections_are_given_up_before_terrace_closes_them(self):
        upstream = re.search(r"upstream terrace \{(.*?)\n\}", TEMPLATE.read_text(), re.DOTALL)[1]
        seconds = float(re.search(r"keepalive_timeout (\d+)s;", upstream)[1])
        printed = subprocess.run([BINARY, "serve", "--print-config"], check=True, stdout=subprocess.PIPE, text=True).stdout
        self.assertLess(seconds, json.loads(printed)["idle_timeout_s"])

    def test_http2_over_tls(self):
        reply = self.get(TILE)
        self.assertEqual((reply.version, reply.status), ("2", 200))
        self.assertEqual(reply.body, self.direct(TILE).body)
        self.assertEqual(self.get(TILE, "--http1.1").version, "1.1")

    def test_plain_http_is_sent_to_https(self):
        reply = self.get("/earth/layer.json?error=5", port=self.http_port, scheme="http")
        self.assertEqual((reply.status, reply.fields["location"]), (308, f"https://localhost:{self.port}/earth/layer.json?error=5"))

    def test_tiles_are_cached(self):
        target = "/earth/4/8/10.terrain"
        self.assertEqual(self.get(target).fields["x-cache"], "MISS")
        for _ in range(3):
            self.assertEqual(self.get(target).fields["x-cache"], "HIT")
        self.get("/earth/4/8/9.terrain?error=77")
        self.assertEqual(len(self.lines_with("error=77")), 1)  # written after the lines of the hits, if there were any
        self.assertEqual(len(self.lines_with(target)), 1)

    def test_requests_with_known_parameters_are_cached(self):
        version = self.version()
        for target in (f"/earth/4/8/11.terrain?v={version}&error=50&atleast=1", "/earth/3/4/5.terrain?extensions=octvertexnormals-watermask",
                       "/earth/heights?locations=1,2%7C3%2C4", "/earth/heights?locations=1,%203",
                       f"/earth/grid?crs=EPSG:32632&bbox=400000,5000000,500000,5100000&width=2&height=2&v={version}",
                       f"/earth/3dtiles/0-0-0/0/0/0.6.subtree?v={version}&error=50&atleast=1",
                       f"/earth/3/2/3.glb?compression=meshopt&v={version}", "/earth/3/2/3.png?encoding=terrarium&size=512"):
            self.assertEqual([self.get(target).fields["x-cache"] for _ in range(2)], ["MISS", "HIT"], target)

    def version(self):
        return json.loads(self.get("/earth/layer.json").body)["version"]

    def test_versions_are_kept_apart_and_only_the_current_one_is_kept(self):
        tile, version = "/earth/4/9/10.terrain", self.version()
        for _ in range(2):
            old = self.get(f"{tile}?v=0123456789ab")
            self.assertEqual((old.status, old.fields["x-cache"], old.fields["cache-control"]), (200, "MISS", "no-store"))
        for turn in ("MISS", "HIT"):
            current = self.get(f"{tile}?v={version}")
            self.assertEqual((current.fields["x-cache"], current.fields["cache-control"]), (turn, "public, max-age=31536000, immutable"))
        self.assertEqual(current.body, old.body)
        self.assertEqual(self.get(tile).fields["x-cache"], "MISS", "without a version it is another URL")

    def test_documents_come_from_terrace_each_time(self):
        for target in ("/earth/layer.json", "/earth/layer.json?error=50", "/earth/tileset.json?error=50&compression=meshopt",
                       "/earth/tiles.json", "/earth/hillshade/tiles.json", "/openapi.json", "/datasets", "/", "/viewer/app.js"):
            tag = self.get(target, headers=["Accept-Encoding: gzip"]).fields["etag"]
            before = self.count_unchanged()
            again = self.get(target, headers=["Accept-Encoding: gzip", f"If-None-Match: {tag}"])
            kept = "private, no-cache" if target == "/datasets" else "no-cache"  # the list depends on the client
            self.assertEqual((again.status, again.body, again.fields["cache-control"]), (304, b"", kept), target)
            end = time.monotonic() + 10  # nginx writes a line after its reply
            while self.count_unchanged() == before and time.monotonic() < end:
                time.sleep(0.02)
            self.assertEqual(self.count_unchanged(), before + 1, target)
            self.assertNotIn("x-cache", again.fields)

    def count_unchanged(self):
        """Replies of terrace without a body, because the client has the bytes."""
        return sum(line["status"] == 304 for line in self.log_lines())

    def test_codings_are_kept_apart(self):
        target = "/earth/4/10/10.terrain"
        plain = self.direct(target).body
        tags = {}
        for turn in ("MISS", "HIT"):
            for coding in ("gzip", "identity", "br"):
                reply = self.get(target, headers=[f"Accept-Encoding: {coding}"])
                self.assertEqual(reply.status, 200)
                self.assertEqual(reply.fields.get("content-encoding", "identity"), coding)
                self.assertEqual(reply.fields["x-cache"], turn)
                if coding == "br":
                    self.assertEqual(reply.body, self.direct(target, "Accept-Encoding: br").body)
                else:
                    self.assertEqual(gzip.decompress(reply.body) if coding == "gzip" else reply.body, plain)
                tags.setdefault(reply.fields["etag"], set()).add(coding)
        self.assertEqual(len(tags), 3)

    def test_extensions_in_accept_are_kept_apart(self):
        target = "/earth/4/11/10.terrain"
        plain = self.get(target)
        normals = self.get(target, headers=["Accept: application/vnd.quantized-mesh;extensions=octvertexnormals"])
        self.assertGreater(len(normals.body), len(plain.body))
        self.assertEqual(self.get(target).body, plain.body)

    def test_revalidation(self):
        for coding in ("gzip", "br", "identity"):
            field = f"Accept-Encoding: {coding}"
            tag = self.get(TILE, headers=[field]).fields["etag"]
            unchanged = self.get(TILE, headers=[field, f"If-None-Match: {tag}"])
            self.assertEqual((unchanged.status, unchanged.body), (304, b""))
            self.assertEqual(unchanged.fields["etag"], tag)
            self.assertEqual(self.get(TILE, headers=[field, 'If-None-Match: "other"']).status, 200)

    def test_ranges(self):
        whole = self.get(TILE)
        part = self.get(TILE, headers=["Range: bytes=10-19"])
        # HTTP allows servers to ignore ranges: the reply is the whole tile, never a part marked as the whole.
        self.assertEqual((part.status, part.body), (200, whole.body))
        self.assertEqual(part.fields["etag"], whole.fields["etag"])

    def test_terrace_sees_the_client(self):
        # An address of the loopback other than nginx's; a forged client address must be ignored.
        reply = self.get("/earth/heights?locations=1,2", "--interface", "127.0.0.2", headers=["X-Forwarded-For: 192.0.2.9", "Forwarded: for=192.0.2.9"])
        self.assertEqual(reply.status, 200)
        self.assertEqual([line["route"] for line in self.lines_with("127.0.0.2")], ["heights"])

    def test_documents_name_the_host_that_was_asked(self):
        tiles = json.loads(self.get("/earth/tiles.json", headers=["Host: maps.example"]).body)["tiles"][0]
        self.assertTrue(tiles.startswith("https://maps.example/earth/"), tiles)

    def test_what_depends_on_a_token_is_not_cached(self):
        target = "/secret/9/272/359.terrain"
        token = f"Authorization: Bearer {TOKEN}"
        for headers, query in (([token], ""), ([], f"?token={TOKEN}")):
            for _ in range(2):
                reply = self.get(target + query, headers=headers)
                self.assertEqual((reply.status, reply.fields["x-cache"]), (200, "BYPASS"))
                self.assertTrue(reply.fields["cache-control"].startswith("private"), reply.fields["cache-control"])
        # Unusual spellings, also for public datasets.
        for base in (target, TILE, "/earth/layer.json", "/"):
            for rest in ("?Token=", "?TOKEN=", "?%54oken=", "?tok%65n=", "?token%3D", "?%2574oken=", "?;token=", "?v=1;token=", "?error=5;token=",
                         "?extensions=metadata;token=", "?access_token=", "?token[]=", "?amp;token=", "?", "?v=1&key=", ";token=",
                         "%3Ftoken=", "%3Ftoken%3D", "/token="):
                for _ in range(2):
                    reply = self.get(base + rest + TOKEN, "-g")
                    self.assertIn(reply.fields.get("x-cache"), ("BYPASS", None), base + rest)  # None: the location has no cache
                    self.assertTrue(reply.fields["cache-control"].startswith("private"), base + rest)
        reply = self.get(f"{TILE}?token={TOKEN}", port=self.http_port, scheme="http")
        self.assertEqual((reply.status, reply.fields["cache-control"]), (308, "private, no-store"))
        self.assertEqual(self.get(target).status, self.direct(target).status)
        self.assertIn(self.get(target).status, (401, 404))
        for file in self.folder.rglob("*"):  # logs of nginx, and its cache, whose entries contain the query in their key
            if file.is_file() and file.suffix != ".json":  # the server's configuration is such a file
                self.assertNotIn(TOKEN.encode(), file.read_bytes(), file)

    def test_heights_by_post(self):
        reply = self.get("/earth/heights", "--data-binary", '{"locations": "1,2"}', headers=["Content-Type: application/json"])
        self.assertEqual((reply.status, len(json.loads(reply.body)["results"])), (200, 1))

    def test_the_most_rays_of_a_request(self):
        end = "46.12345678901234,-122.12345678901234,1234.12345678901234"
        body = self.folder / "rays.json"
        body.write_text(json.dumps({"rays": "|".join([f"{end},{end}"] * 9999)}))
        self.assertGreater(body.stat().st_size, 2**20)
        direct = self.get("/earth/sight", "--data-binary", f"@{body}", headers=["Content-Type: application/json"], port=self.terrace_port, scheme="http")
        reply = self.get("/earth/sight", "--data-binary", f"@{body}", headers=["Content-Type: application/json"])
        self.assertEqual((reply.status, reply.body), (direct.status, direct.body), reply.body[:200])

    def test_metrics_are_not_for_everybody(self):
        self.assertEqual(self.get("/metrics").status, 404)

    def test_errors_pass(self):
        reply = self.get("/earth/0/9/0.terrain")
        self.assertEqual((reply.status, reply.fields["content-type"]), (404, "application/problem+json"))
        self.assertEqual(reply.fields["access-control-allow-origin"], "*")


if __name__ == "__main__":
    missing = [tool for tool in ("nginx", "curl", "openssl") if not shutil.which(tool)]
    if missing:
        print(f"SKIPPED: nginx_e2e_test needs {', '.join(missing)}; tools/install_deps.sh --test installs it")
        sys.exit(77)
    unittest.main()
