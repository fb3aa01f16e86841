"""A file server that answers range requests, as object stores do, and counts them."""
import http.server
import pathlib
import re
import threading


class RangeServer:
    """Serves the files of a folder at `url` while it is open. `requests` and `bytes` count what was answered.

    `before`: called with the first and the last byte before a body is sent; may wait. False: the reply is 500."""

    def __init__(self, folder, before=lambda first, last: True):
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def reply(self, has_body):
                path = pathlib.Path(folder) / pathlib.PurePosixPath(self.path).name
                if not path.is_file():
                    self.send_response(404)
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                size, (first, last) = path.stat().st_size, (0, path.stat().st_size - 1)
                wanted = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
                if wanted:
                    first, last = int(wanted[1]), min(int(wanted[2] or last), last)
                if has_body and not before(first, last):
                    self.send_response(500)
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                self.send_response(206 if wanted else 200)
                self.send_header("Accept-Ranges", "bytes")
                self.send_header("Content-Length", str(last - first + 1))
                self.send_header("ETag", '"1"')
                if wanted:
                    self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
                self.end_headers()
                with outer.lock:
                    outer.requests += 1
                    outer.bytes += last - first + 1 if has_body else 0
                if has_body:
                    with path.open("rb") as file:
                        file.seek(first)
                        self.wfile.write(file.read(last - first + 1))

            def do_GET(self):
                self.reply(True)

            def do_HEAD(self):
                self.reply(False)

        self.lock, self.requests, self.bytes = threading.Lock(), 0, 0
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/"

    def __enter__(self):
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()
