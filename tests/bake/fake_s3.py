"""A store of objects that speaks as much of S3 as GDAL uses: whole objects, ranges, lists, uploads in parts. Path style, one bucket or more, no
signatures checked. Objects appear when their request or upload is complete, as in S3."""
import contextlib
import http.server
import re
import threading
import urllib.parse
from xml.sax.saxutils import escape


class FakeS3:
    def __init__(self):
        self.objects, self.uploads, self.requests, self.lock = {}, {}, [], threading.Lock()
        # refuse(method, key, query) is a status to answer with, or None. `started`: before the body is read.
        self.refuse = lambda method, key, query: None
        store = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def reply(self, status, body=b"", **headers):
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name.replace("_", "-"), value)
                if "Content_Length" not in headers:
                    self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                if self.command != "HEAD":
                    with contextlib.suppress(OSError):
                        self.wfile.write(body)

            def error(self, status, code):
                self.reply(status, f"<?xml version='1.0'?><Error><Code>{code}</Code><Message>{code}</Message></Error>".encode(),
                           Content_Type="application/xml")

            def handle_one(self):
                path, _, query = self.path.partition("?")
                key, query = urllib.parse.unquote(path).lstrip("/"), dict(urllib.parse.parse_qsl(query, keep_blank_values=True))
                with store.lock:
                    store.requests.append((self.command, key, query))
                length = int(self.headers.get("Content-Length") or 0)
                body = self.rfile.read(length)
                if len(body) < length:  # the client was killed
                    self.close_connection = True
                    return None
                if status := store.refuse(self.command, key, query):
                    return self.error(status, {403: "AccessDenied", 503: "SlowDown"}.get(status, "InternalError"))
                with store.lock:
                    getattr(self, "do" + self.command)(key, query, body)

            def doPUT(self, key, query, body):
                if "partNumber" in query:
                    store.uploads[query["uploadId"]][int(query["partNumber"])] = body
                else:
                    store.objects[key] = body
                self.reply(200, ETag=f'"{len(body)}"')

            def doPOST(self, key, query, body):
                if "uploads" in query:
                    name = f"upload-{len(store.requests)}"
                    store.uploads[name] = {}
                    return self.reply(200, f"<InitiateMultipartUploadResult><UploadId>{name}</UploadId></InitiateMultipartUploadResult>".encode())
                parts = store.uploads.pop(query["uploadId"])
                store.objects[key] = b"".join(parts[number] for number in sorted(parts))
                self.reply(200, b"<CompleteMultipartUploadResult></CompleteMultipartUploadResult>")

            def doDELETE(self, key, query, body):
                if "uploadId" in query:
                    store.uploads.pop(query["uploadId"], None)
                else:
                    store.objects.pop(key, None)
                self.reply(204)

            def doHEAD(self, key, query, body):
                self.doGET(key, query, body)

            def doGET(self, key, query, body):
                if "/" not in key.rstrip("/"):
                    return self.list(key.strip("/"), query)
                if key not in store.objects:
                    return self.error(404, "NoSuchKey")
                data = store.objects[key]
                if found := re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")):
                    first, last = int(found[1]), min(int(found[2] or len(data) - 1), len(data) - 1)
                    if first >= len(data):
                        return self.error(416, "InvalidRange")
                    part = data[first:last + 1]
                    return self.reply(206, part, Content_Range=f"bytes {first}-{last}/{len(data)}", Last_Modified="Thu, 01 Jan 2026 00:00:00 GMT",
                                      Content_Length=str(len(part)))
                self.reply(200, data, Last_Modified="Thu, 01 Jan 2026 00:00:00 GMT", Content_Length=str(len(data)), ETag=f'"{len(data)}"')

            def list(self, bucket, query):
                prefix, delimiter, folders, files = query.get("prefix", ""), query.get("delimiter", ""), set(), []
                for key in sorted(store.objects):
                    if not key.startswith(f"{bucket}/{prefix}"):
                        continue
                    name = key[len(bucket) + 1:]
                    rest = name[len(prefix):]
                    if delimiter and delimiter in rest:
                        folders.add(prefix + rest.partition(delimiter)[0] + delimiter)
                    else:
                        files.append((name, len(store.objects[key])))
                text = "".join(f"<Contents><Key>{escape(name)}</Key><LastModified>2026-01-01T00:00:00.000Z</LastModified><Size>{size}</Size>"
                               f"<StorageClass>STANDARD</StorageClass></Contents>" for name, size in files)
                text += "".join(f"<CommonPrefixes><Prefix>{escape(name)}</Prefix></CommonPrefixes>" for name in sorted(folders))
                self.reply(200, f"<?xml version='1.0'?><ListBucketResult><Name>{bucket}</Name><Prefix>{escape(prefix)}</Prefix><IsTruncated>false"
                                f"</IsTruncated>{text}</ListBucketResult>".encode(), Content_Type="application/xml")

            do_PUT = do_POST = do_DELETE = do_HEAD = do_GET = handle_one

        class Server(http.server.ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *_):  # a client that was killed
                pass
        self.server = Server(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def environment(self):
        return {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "a-secret-key", "AWS_REGION": "us-east-1", "AWS_VIRTUAL_HOSTING": "FALSE",
                "AWS_HTTPS": "NO", "AWS_S3_ENDPOINT": f"127.0.0.1:{self.server.server_address[1]}"}

    def files(self, place):
        """{name: bytes} below "bucket/prefix"."""
        with self.lock:
            return {key[len(place) + 1:]: data for key, data in self.objects.items() if key.startswith(place + "/")}

    def close(self):
        with contextlib.suppress(OSError):
            self.server.shutdown()
            self.server.server_close()
