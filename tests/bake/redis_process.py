"""A redis-server of one test, and a client that knows just enough to look into it."""
import contextlib
import random
import shutil
import socket
import subprocess
import threading
import time


def free_port():
    """Below the ports that Linux gives to connections, one of which could take it before it is used."""
    while True:
        port = random.randrange(10000, 32768)
        with contextlib.closing(socket.socket()) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Redis:
    """--save "" and no AOF unless `options` say otherwise; its data lie in `folder`."""

    def __init__(self, folder, *options):
        self.folder, self.options, self.port, self.process = folder, options, free_port(), None
        self.start()

    @property
    def url(self):
        return f"redis://127.0.0.1:{self.port}/0"

    def start(self):
        self.folder.mkdir(exist_ok=True)
        self.process = subprocess.Popen(
            ["redis-server", "--port", str(self.port), "--bind", "127.0.0.1", "--dir", self.folder, "--save", "", *self.options],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until = time.monotonic() + 20
        while time.monotonic() < until:
            with contextlib.suppress(OSError):
                if not str(self("PING")).startswith("LOADING"):
                    return
            time.sleep(0.02)
        raise RuntimeError("redis-server does not start")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def lose(self):
        """Everything, also on the disk."""
        self.kill()
        shutil.rmtree(self.folder)

    def __call__(self, *command):
        """The reply: str, int, None or a list; an error as its text."""
        with contextlib.closing(socket.create_connection(("127.0.0.1", self.port), 10)) as connection:
            connection.sendall(encode(command))
            return reply(connection.makefile("rb"))


def encode(command):
    parts = [str(part).encode() for part in command]
    return b"*%d\r\n" % len(parts) + b"".join(b"$%d\r\n%s\r\n" % (len(part), part) for part in parts)


def reply(stream):
    line = stream.readline()
    if not line:
        raise ConnectionError("Redis closed the connection")
    kind, rest = line[:1], line[1:-2]
    if kind in b"+-":
        return rest.decode()
    if kind == b":":
        return int(rest)
    if int(rest) < 0:
        return None
    if kind == b"$":
        return stream.read(int(rest) + 2)[:-2].decode()
    return [reply(stream) for _ in range(int(rest))]


class Listener:
    """Calls play(connection) for each connection to its port, in threads."""

    def __init__(self, play):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.play = play
        threading.Thread(target=self.accept, daemon=True).start()

    @property
    def url(self):
        return f"redis://127.0.0.1:{self.port}/0"

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self.socket.accept()
                threading.Thread(target=self.run, args=(connection,), daemon=True).start()

    def run(self, connection):
        with contextlib.suppress(OSError), connection:
            self.play(connection)

    def close(self):
        self.socket.close()


def proxy(port, change):
    """A Listener in front of a Redis. change(bytes) is what a piece of a reply becomes; None: the connection ends."""
    def play(client):
        with contextlib.closing(socket.create_connection(("127.0.0.1", port))) as server:
            def forward():
                with contextlib.suppress(OSError):
                    while data := client.recv(65536):
                        server.sendall(data)
                with contextlib.suppress(OSError):
                    server.shutdown(socket.SHUT_RDWR)
            threading.Thread(target=forward, daemon=True).start()
            while data := server.recv(65536):
                changed = change(data)
                if changed is None:
                    client.shutdown(socket.SHUT_RDWR)
                    return
                client.sendall(changed)
    return Listener(play)
