"""Restarts a server on a listening socket that another process holds, under clients with persistent connections (row 43).

A client repeats a request only if HTTP allows it (RFC 9112, section 9.3.1): the connection had been used before, and was closed,
not reset, before the first byte of the reply.
"""
import contextlib
import fcntl
import os
import pathlib
import random
import select
import signal
import socket
import subprocess
import threading
import time

SAMPLES = pathlib.Path(__file__).resolve().parents[2] / "config/samples/samples.json"
TARGETS = [f"/jacksboro/11/{column}/{row}.{suffix}" for column in range(1087, 1092) for row in range(1435, 1439)
           for suffix in ("terrain", "glb")] + ["/jacksboro/layer.json", "/earth/0/0/0.terrain", "/datasets"]
# As systemd does: the socket is descriptor 3, and the variables name this process.
PASS = 'export LISTEN_PID=$$ LISTEN_FDS=1; exec "${@:2}" 3<&"$1"'


class HeldSocket:
    """with HeldSocket() as held: process = held.start(binary, "serve", ...)"""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0), backlog=1024)
        self.port = self.listener.getsockname()[1]

    def start(self, *command, **options):
        number = self.listener.fileno()
        return subprocess.Popen(["bash", "-c", PASS, "bash", str(number), *map(str, command)], pass_fds=(number,),
                                stdout=subprocess.PIPE, text=True, **options)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()


@contextlib.contextmanager
def leased(path):
    """While this is active, opening the file blocks for up to 45 s, as on a mount that does not answer."""
    before = signal.signal(signal.SIGIO, signal.SIG_IGN)
    with open(path, "rb+") as file:
        fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_WRLCK)
        yield
    signal.signal(signal.SIGIO, before)


class Lost(Exception):
    """A request got no reply."""


class PatientClient:
    """Sends requests on one connection as long as it stays open."""

    def __init__(self, port, timeout=60):
        self.port, self.timeout, self.connection, self.again = port, timeout, None, 0

    def is_closed(self):
        return self.connection is None or bool(select.select([self.connection], [], [], 0)[0])

    def close(self):
        if self.connection:
            self.connection.close()
        self.connection = None

    def ask(self, target):
        if self.is_closed():
            self.close()
        while True:
            was_used = self.connection is not None
            if not was_used:
                self.connection = socket.create_connection(("127.0.0.1", self.port), self.timeout)
            status = self.exchange(target, was_used)
            if status:
                return status
            self.again += 1

    def exchange(self, target, was_used):
        """The status, or nothing if the request may be repeated."""
        reply = b""
        try:
            self.connection.sendall(f"GET {target} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
            while b"\r\n\r\n" not in reply:
                piece = self.connection.recv(65536)
                if not piece:
                    self.close()
                    if was_used and not reply:
                        return None
                    raise Lost(f"{target}: closed after {len(reply)} bytes")
                reply += piece
            head, _, body = reply.partition(b"\r\n\r\n")
            lines = head.decode("latin-1").lower().split("\r\n")
            fields = dict(line.split(": ", 1) for line in lines[1:])
            missing = int(fields["content-length"]) - len(body)
            while missing > 0:
                piece = self.connection.recv(65536)
                if not piece:
                    raise Lost(f"{target}: {missing} bytes are missing")
                missing -= len(piece)
        except OSError as error:
            self.close()
            raise Lost(f"{target}: {error}") from error
        if fields.get("connection") == "close":
            self.close()
        return int(lines[0].split()[1])


class Load:
    """Clients that send requests in a loop, with occasional pauses of up to a second; `failures` lists errors."""

    def __init__(self, port, clients, targets):
        self.stop, self.failures, self.count, self.again, self.slowest = threading.Event(), [], 0, 0, 0
        self.lock = threading.Lock()
        self.threads = [threading.Thread(target=self.run, args=(port, targets, random.Random(i))) for i in range(clients)]

    def run(self, port, targets, chance):
        client = PatientClient(port)
        while not self.stop.is_set():
            begun, failure = time.monotonic(), None
            try:
                status = client.ask(chance.choice(targets))
                failure = None if status == 200 else f"status {status}"
            except (Lost, OSError) as error:
                failure = repr(error)
                client.close()
            with self.lock:
                self.count += 1
                self.slowest = max(self.slowest, time.monotonic() - begun)
                self.failures += [failure] if failure else []
            if chance.random() < 0.2:
                time.sleep(chance.random())
        with self.lock:
            self.again += client.again
        client.close()

    def __enter__(self):
        for thread in self.threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        for thread in self.threads:
            thread.join()


def restart_under_load(binary, times, clients, targets, *arguments):
    """Runs the load during the restarts, and returns it. Each server must end with status 0."""
    with HeldSocket() as held, contextlib.ExitStack() as after:
        def start():
            process = held.start(binary, "serve", *arguments, stderr=subprocess.DEVNULL)
            after.callback(process.stdout.close)
            after.callback(process.kill)
            return process

        process = start()
        load = Load(held.port, clients, targets)
        with load:
            process.stdout.readline()  # returns when the server is ready
            for _ in range(times):
                time.sleep(0.5)
                os.kill(process.pid, signal.SIGTERM)
                if process.wait(60) != 0:
                    load.failures.append(f"a server ended with status {process.returncode}")
                process = start()
                if "serving" not in process.stdout.readline():
                    load.failures.append("a server did not start")
            time.sleep(0.5)
        os.kill(process.pid, signal.SIGTERM)
        process.wait(60)
        return load
