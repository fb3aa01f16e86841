"""A real redis-server on a free port, and a proxy before it that delays, cuts or falsifies what it replies."""
import contextlib
import pathlib
import socket
import subprocess
import tempfile
import threading
import time

import cluster


class Redis:
    def __init__(self, folder, *options):
        self.folder, self.options = pathlib.Path(tempfile.mkdtemp(dir=folder)), options
        self.port, self.process = cluster.free_port(), None

    def start(self, port_option="--port"):
        self.process = subprocess.Popen(["redis-server", port_option, str(self.port), "--bind", "127.0.0.1", "--save", "", "--appendonly", "no",
                                         "--dir", self.folder, *self.options], stdout=subprocess.DEVNULL)
        cluster.wait_for_port(self.port)
        return self

    def signal(self, number):
        self.process.send_signal(number)

    def stop(self):
        if self.process and self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def call(self, *words):
        """The reply to one command of plain text as redis-cli prints it."""
        return subprocess.run(["redis-cli", "-p", str(self.port), *words], check=True, stdout=subprocess.PIPE, timeout=30).stdout.decode("latin-1").strip()

    def ask(self, *words):
        """A command with bytes as arguments: what Redis sends, undecoded."""
        command = b"*%d\r\n" % len(words) + b"".join(b"$%d\r\n%s\r\n" % (len(word), word) for word in words)
        with socket.create_connection(("127.0.0.1", self.port), 10) as connection:
            connection.sendall(command)
            return self.read_reply(connection.makefile("rb"))

    @classmethod
    def read_reply(cls, file):
        line = file.readline()
        kind, rest = line[:1], line[1:-2]
        if kind == b"$":
            return None if rest == b"-1" else file.read(int(rest) + 2)[:-2]
        if kind == b"*":
            return [cls.read_reply(file) for _ in range(int(rest))]
        return int(rest) if kind == b":" else rest

    def keys(self):
        return sorted(self.ask(b"KEYS", b"terrace:tile:*"))


class Proxy:
    """`change(reply)`: what the client gets of a piece of a reply, or None to cut the connection. `delay`: seconds before each piece."""

    def __init__(self, port):
        self.target, self.change, self.delay = port, lambda piece: piece, 0.0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self.serve, args=(client,), daemon=True).start()

    def serve(self, client):
        try:
            server = socket.create_connection(("127.0.0.1", self.target), 10)
        except OSError:
            client.close()
            return
        server.settimeout(None)
        threading.Thread(target=self.pump, args=(client, server, False), daemon=True).start()
        self.pump(server, client, True)

    def pump(self, source, sink, is_reply):
        try:
            while piece := source.recv(1 << 16):
                if is_reply:
                    time.sleep(self.delay)
                    piece = self.change(piece)
                    if piece is None:
                        break
                sink.sendall(piece)
        except OSError:
            pass
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        if is_reply:
            source.close()
            sink.close()

    def close(self):
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
