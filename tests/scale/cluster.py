"""A cluster of processes: nodes of terrace behind a real nginx with docker/nginx.conf.template and docker/cluster/nodes.conf,
in which only addresses and folders are replaced; and clients that never retry.
"""
import asyncio
import contextlib
import gzip
import hashlib
import json
import pathlib
import random
import re
import shutil
import signal
import socket
import ssl
import subprocess
import tempfile
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
TEMPLATE = ROOT / "docker/nginx.conf.template"
NODES = ROOT / "docker/cluster/nodes.conf"
SAMPLES = ROOT / "config/samples"
FOR_GOOD = "immutable"


GIVEN_PORTS = set()


def free_port():
    """Never the same port twice: it may be used later than the next one is asked for. Below the ports that Linux gives to connections, one of
    which could take it meanwhile."""
    while True:
        port = random.randrange(10000, 32768)
        if port in GIVEN_PORTS:
            continue
        with socket.socket() as s, contextlib.suppress(OSError):
            s.bind(("127.0.0.1", port))
            GIVEN_PORTS.add(port)
            return port


def wait_for_port(port, seconds=60):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.02)
    raise RuntimeError(f"nobody listens on port {port}")


class Node:
    """One server with a folder of its own. It keeps its port through restarts."""

    def __init__(self, binary, folder, datasets, options=None, environment=None):
        self.binary, self.port, self.folder = binary, free_port(), pathlib.Path(tempfile.mkdtemp(dir=folder))
        self.environment = environment
        self.config = {"listen": f"127.0.0.1:{self.port}", "datasets": datasets, "viewer": False, "access_log": "off", "io_threads": 1,
                       "trusted_proxies": ["127.0.0.1"], "cache_dir": str(pathlib.Path(folder) / "statistics"), **(options or {})}
        self.process = None

    def start(self, waits=True):
        path = self.folder / "terrace.json"
        path.write_text(json.dumps(self.config))
        with open(self.folder / "log", "a") as log:
            self.process = subprocess.Popen([self.binary, "serve", "--config", path], stdout=subprocess.PIPE, stderr=log, text=True,
                                            env=self.environment)
        if waits:
            self.wait_until_served()
        return self

    def wait_until_served(self):
        if "serving" not in self.process.stdout.readline():
            raise RuntimeError(f"did not start: {self.log()}")

    def log(self):
        return (self.folder / "log").read_text()

    def stop(self, how=signal.SIGTERM):
        """The exit status."""
        if self.process is None:
            return 0
        self.process.send_signal(how)
        status = self.process.wait(60)
        self.process.stdout.close()
        self.process = None
        return status

    def get(self, target):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{target}", timeout=60) as reply:
            return reply.read()

    def metrics(self):
        """{'name{labels}': value}"""
        lines = self.get("/metrics").decode().splitlines()
        return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines if not line.startswith("#"))}

    def sum_of(self, name, labels=""):
        time.sleep(1.1)  # how long a text of /metrics is reused
        return sum_of(self.metrics(), name, labels)

    def version(self):
        return json.loads(self.get("/version"))["datasets"][0]["version"]


def sum_of(metrics, name, labels=""):
    return sum(value for series, value in metrics.items() if series.partition("{")[0] == name and labels in series)


class Nginx:
    """The configuration that is shipped, on free ports. `nodes`: in the order of the file; more are added to it. Without TLS for clients
    that take only certificates of the system. `changes`: texts of the template to replace."""

    def __init__(self, folder, nodes, is_tls=True, changes=()):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=folder))
        self.folder.chmod(0o755)  # nginx's workers run as another user
        self.port = free_port()
        certificates = self.folder / "certificates"
        certificates.mkdir()
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                        "-subj", "/CN=localhost", "-keyout", certificates / "tls.key", "-out", certificates / "tls.crt"], check=True,
                       stderr=subprocess.DEVNULL)
        self.write_nodes(nodes)
        values = {"TERRACE_NODES": self.folder / "nodes.conf", "TERRACE_HTTP_PORT": free_port(), "TERRACE_HTTPS_PORT": self.port,
                  "TERRACE_CERTIFICATES": certificates, "TERRACE_CACHE": self.folder / "cache"}
        template = TEMPLATE.read_text()
        for old, new in changes:
            if old not in template:
                raise ValueError(f"the template has no {old!r}")
            template = template.replace(old, new)
        filled = re.sub(r"\$\{(TERRACE_\w+)\}", lambda match: str(values[match[1]]), template)
        filled = filled.replace("/dev/stdout", str(self.folder / "access.log")).replace("/dev/stderr", str(self.folder / "error.log"))
        if not is_tls:
            filled = re.sub(r" ssl http2;|^  ssl_.*$", lambda match: ";" if match[0].startswith(" ssl ") else "", filled, flags=re.MULTILINE)
        paths = "\n".join(f"  {name}_temp_path {self.folder}/{name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        (self.folder / "nginx.conf").write_text(
            f"daemon off; worker_processes 1; pid {self.folder}/nginx.pid; events {{ worker_connections 1024; }}\n"
            f"http {{\n{paths}\n{filled}\n}}\n")
        self.process = None

    def write_nodes(self, nodes):
        lines, ports = [], iter([node.port for node in nodes])
        pattern = re.compile(r"^server [\d.]+:8080")
        for line in NODES.read_text().splitlines():
            if pattern.match(line):
                port = next(ports, None)
                if port is None:
                    continue
                last = line
                line = pattern.sub(f"server 127.0.0.1:{port}", line)
            lines.append(line)
        lines += [pattern.sub(f"server 127.0.0.1:{port}", last) for port in ports]
        (self.folder / "nodes.conf").write_text("\n".join(lines) + "\n")

    def start(self):
        self.process = subprocess.Popen(["nginx", "-e", self.folder / "error.log", "-c", self.folder / "nginx.conf"])
        wait_for_port(self.port)
        return self

    def reload(self, nodes):
        """As `nginx -s reload` does: old workers finish their requests."""
        self.write_nodes(nodes)
        self.process.send_signal(signal.SIGHUP)

    def stop(self):
        self.process.send_signal(signal.SIGQUIT)
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def node_of(self):
        """{target's path: address of the node that answered last}, from the access log."""
        found = {}
        for line in (self.folder / "access.log").read_text().splitlines():
            match = re.search(r'"GET (\S+) HTTP/[\d.]+" (\d+) .* (\S+)$', line)
            if match and match[3] != "-":
                found[match[1]] = match[3]
        return found


class Failed(Exception):
    """A request got no reply, or half of one."""


class Client:
    """One connection of HTTP/1.1 that stays open as long as the server keeps it. It repeats nothing; with `is_curl` it repeats
    what libcurl repeats: a request on a connection that had been used before and ended before a byte of the reply (RFC 9112, 9.3.1).
    """

    def __init__(self, port, is_tls=True, is_curl=False):
        self.port, self.context, self.stream, self.is_curl, self.repeated = port, None, None, is_curl, 0
        if is_tls:
            self.context = ssl.create_default_context()
            self.context.check_hostname, self.context.verify_mode = False, ssl.CERT_NONE

    def close(self):
        if self.stream:
            self.stream[1].close()
        self.stream = None

    async def get(self, target):
        """(status, fields, body)"""
        try:
            was_used = self.stream is not None
            try:
                return await asyncio.wait_for(self.exchange(target), 60)
            except (asyncio.IncompleteReadError, ConnectionError) as error:
                if not self.is_curl or not was_used or getattr(error, "partial", b""):
                    raise
            self.close()
            self.repeated += 1
            return await asyncio.wait_for(self.exchange(target), 60)
        except (OSError, EOFError, ValueError, asyncio.TimeoutError, ssl.SSLError) as error:
            self.close()
            raise Failed(f"{target}: {error!r}") from error

    async def exchange(self, target):
        if self.stream and self.stream[0].at_eof():
            self.close()  # the server has said so before this request
        if self.stream is None:
            self.stream = await asyncio.open_connection("127.0.0.1", self.port, ssl=self.context, limit=1 << 20)
        reader, writer = self.stream
        writer.write(f"GET {target} HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: gzip\r\n\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
        fields = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in head[1:])}
        if fields.get("transfer-encoding") == "chunked":
            body = b""
            while size := int(await reader.readline(), 16):
                body += await reader.readexactly(size)
                await reader.readline()
            await reader.readline()
        else:
            body = await reader.readexactly(int(fields.get("content-length", 0)))
        if fields.get("connection") == "close":
            self.close()
        return int(head[0].split()[1]), fields, body


def plain(fields, body):
    return gzip.decompress(body) if fields.get("content-encoding") == "gzip" else body


class Seen:
    """What an outside checker saw: every reply's status, and for each name (URL, and what the reply says that it is) its bytes."""

    def __init__(self):
        self.replies, self.repeated, self.failures, self.bodies, self.wrong, self.milliseconds = 0, 0, [], {}, [], []

    def add(self, target, name, status, body, milliseconds=0.0):
        self.replies += 1
        self.milliseconds.append(milliseconds)
        if status != 200:
            self.failures.append(f"{target}: {status}")
            return
        digest = hashlib.sha256(body).digest()
        if self.bodies.setdefault(name, digest) != digest:
            self.wrong.append(name)


async def draw(port, clients, targets, seen, is_tls=True, until=None, pause=0.0, is_curl=False):
    """Clients take targets in turn from the list: once through it, or around until `until()`."""
    place = [0]

    async def run():
        client = Client(port, is_tls, is_curl)
        while (until is None and place[0] < len(targets)) or (until is not None and not until()):
            target = targets[place[0] % len(targets)]
            place[0] += 1
            begun = time.monotonic()
            try:
                status, _, body = await client.get(target)
                seen.add(target, target, status, body, (time.monotonic() - begun) * 1000)
            except Failed as error:
                seen.failures.append(str(error))
            if pause:
                await asyncio.sleep(pause)
        seen.repeated += client.repeated
        client.close()

    await asyncio.gather(*(run() for _ in range(clients)))


@contextlib.contextmanager
def scratch():
    folder = pathlib.Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def earth(folder=SAMPLES):
    return [{"name": "earth", "sources": [str(folder / "etopo5.tif")], "finest_error": 310}]  # levels 0 to 7


def tiles(count, level=6, query=""):
    """Distinct tiles of a level of `earth`, spread over it."""
    every = [(x, y) for x in range(2 ** (level + 1)) for y in range(2 ** level)]
    step = len(every) / count
    return [f"/earth/{level}/{x}/{y}.terrain{query}" for x, y in (every[int(i * step)] for i in range(count))]
