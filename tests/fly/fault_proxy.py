"""A proxy before a tile server that does to tiles what networks and servers do: FaultProxy(upstream, fault)."""
import http.client
import http.server
import re
import socket
import threading
import time

TILE = re.compile(r"\.(terrain|glb)(\?|$)")


class FaultProxy:
    """Passes requests on. `fault(handler, number)` is called for the number-th request of a tile, from 1, and returns
    True if it has answered. `rewrite(path, status, headers, body)` may change other replies."""

    def __init__(self, upstream, fault=None, rewrite=None, tiles_per_second=None):
        proxy = self
        self.tiles, self.lock, self.open = 0, threading.Lock(), set()
        self.next_tile = time.monotonic()

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            disable_nagle_algorithm = True

            def setup(self):
                proxy.open.add(self.request)
                super().setup()

            def finish(self):
                proxy.open.discard(self.request)
                try:
                    super().finish()
                except OSError:
                    pass

            def log_message(self, *_):
                pass

            def reply(self, status, headers, body):
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def do_GET(self):  # noqa: N802
                is_tile = TILE.search(self.path) is not None
                if is_tile:
                    with proxy.lock:
                        proxy.tiles += 1
                        number = proxy.tiles
                        if tiles_per_second:
                            proxy.next_tile = max(proxy.next_tile, time.monotonic()) + 1 / tiles_per_second
                        due = proxy.next_tile
                    if tiles_per_second:
                        time.sleep(max(0, due - time.monotonic()))
                    if fault and fault(self, number):
                        return
                connection = http.client.HTTPConnection(upstream, timeout=60)
                try:
                    connection.request("GET", self.path, headers={name: self.headers[name] for name in ("Accept", "Accept-Encoding")
                                                                  if name in self.headers})
                    answer = connection.getresponse()
                    body = answer.read()
                finally:
                    connection.close()
                headers = {name: value for name, value in answer.getheaders() if name.lower() not in ("content-length", "connection", "date")}
                status = answer.status
                if rewrite:
                    status, headers, body = rewrite(self.path, status, headers, body)
                self.reply(status, headers, body)

        class Server(http.server.ThreadingHTTPServer):
            daemon_threads = True
            request_queue_size = 128

            def handle_error(self, *_):  # clients end at any time
                pass

        self.server = Server(("127.0.0.1", 0), Handler)
        self.address = f"127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()
        for connection in list(self.open):
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


def refuse(handler, retry_after="1"):
    handler.reply(503, {"Retry-After": retry_after, "Content-Type": "text/plain"}, b"busy\n")
    return True


def not_found(handler):
    handler.reply(404, {"Content-Type": "text/plain"}, b"no such tile\n")
    return True


def garbage_body(handler):
    handler.reply(200, {"Content-Type": "application/octet-stream"}, bytes(range(256)) * 4)
    return True


def no_http(handler):
    handler.wfile.write(b"\x16\x03\x01 this is not HTTP at all\r\n\r\n")
    handler.close_connection = True
    return True


def silence(handler):
    """Never answers; the client must give up by itself."""
    try:
        while handler.connection.recv(1):
            pass
    except OSError:
        pass
    handler.close_connection = True
    return True


def close_at_once(handler):
    handler.close_connection = True
    return True


def cut(handler):
    handler.send_response(200)
    handler.send_header("Content-Length", "100000")
    handler.end_headers()
    handler.wfile.write(b"x" * 500)
    handler.wfile.flush()
    handler.close_connection = True
    return True
