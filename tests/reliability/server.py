"""Starts the real binary on a free port, reads data about its process from the system, and talks to it over sockets."""
import os
import pathlib
import re
import resource
import signal
import socket
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config/samples/samples.json"


class Server:
    """with Server(binary, "--max-connections", "100") as server: ..."""

    def __init__(self, binary, *flags, prefix=(), open_files=None):
        def limit():
            if open_files:
                resource.setrlimit(resource.RLIMIT_NOFILE, (open_files, open_files))

        command = [*prefix, str(binary), "serve", "--config", str(CONFIG), "--listen", "127.0.0.1:0", "--log-level", "warn", *flags]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, preexec_fn=limit, text=True)
        line = self.process.stdout.readline()
        self.port = int(re.search(r":(\d+)/", line)[1])
        self.pid = self.process.pid
        while prefix and (children := pathlib.Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text().split()):
            self.pid = int(children[0])  # the prefix may start another process

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            os.kill(self.pid, signal.SIGTERM)
            self.process.wait(30)
        self.process.stdout.close()

    def resident_kib(self):
        return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{self.pid}/status").read_text())[1])

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.pid}/fd"))

    def sockets(self):
        folder = pathlib.Path(f"/proc/{self.pid}/fd")
        return sum(os.readlink(entry).startswith("socket:") for entry in folder.iterdir() if entry.is_symlink())

    def cpu_seconds(self):
        fields = pathlib.Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def connect(self, timeout=10):
        return socket.create_connection(("127.0.0.1", self.port), timeout)


class MemoryGroup:
    """A cgroup with a memory limit, if the system allows one; `prefix` starts a command in it."""

    def __init__(self, limit):
        one = pathlib.Path("/sys/fs/cgroup/memory")  # cgroup version 1, else 2
        self.folder = (one if one.is_dir() else one.parent) / f"terrace-{os.getpid()}"
        self.prefix, self.words = (), "in no cgroup (none could be made)"
        try:
            self.folder.mkdir()
            (self.folder / ("memory.limit_in_bytes" if one.is_dir() else "memory.max")).write_text(str(limit))
        except OSError:
            return
        self.prefix = ("sh", "-c", f'echo $$ > {self.folder}/cgroup.procs && exec "$@"', "sh")
        self.words = f"in a cgroup of {limit >> 20} MB"

    def usage_mb(self):
        """Memory of the group in MB: in all, of processes, and pages of files. Nothing without a group."""
        if not self.prefix:
            return {}
        one = (self.folder / "memory.usage_in_bytes").exists()
        used = (self.folder / ("memory.usage_in_bytes" if one else "memory.current")).read_text()
        parts = dict(line.split() for line in (self.folder / "memory.stat").read_text().splitlines())
        sizes = {"used": used, "anonymous": parts["total_rss" if one else "anon"], "file": parts["total_cache" if one else "file"]}
        return {name: round(int(size) / 2**20, 2) for name, size in sizes.items()}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.folder.is_dir():
            self.folder.rmdir()


def get(target, fields=""):
    return f"GET {target} HTTP/1.1\r\nHost: x\r\n{fields}\r\n".encode()


def read_reply(connection, pending=b""):
    """(status, fields, body, rest), or None if the connection ended before a complete reply. Raises OSError."""
    while b"\r\n\r\n" not in pending:
        piece = connection.recv(65536)
        if not piece:
            return None
        pending += piece
    head, _, body = pending.partition(b"\r\n\r\n")
    lines = head.decode("latin-1").split("\r\n")
    fields = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
    status = int(lines[0].split()[1])
    length = 0 if status in (204, 304) else int(fields.get("content-length", 0))
    while len(body) < length:
        piece = connection.recv(65536)
        if not piece:
            return None
        body += piece
    return status, fields, body[:length], body[length:]


def fetch(server, target, fields="", timeout=10):
    """One request on a new connection: (status, fields, body), or None."""
    with server.connect(timeout) as connection:
        connection.sendall(get(target, fields + "Connection: close\r\n"))
        reply = read_reply(connection)
        return reply and reply[:3]


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(int(len(ordered) * share), len(ordered) - 1)]


def wait_until(condition, seconds):
    """Seconds until the condition was true, or None."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        if condition():
            return time.monotonic() - begun
        time.sleep(0.02)
    return None
