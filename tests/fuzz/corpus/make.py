#!/usr/bin/env python3
"""Writes the seeds of the fuzz targets that read text, each as a file `seed-NAME` of its target's folder.

    tests/fuzz/corpus/make.py

Files with other names are findings of a fuzzer and inputs of targets that read binary data; they are kept.
"""
import json
import pathlib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]

URLS = {
    "tile": "/earth/9/272/359.terrain", "error": "/earth/9/272/359.terrain?error=5&v=1.1.0", "glb": "/earth/0/1/0.glb?compression=meshopt&texture=webp",
    "implicit": "/earth/3dtiles/9-272-359/2/3/1.glb?error=5&atleast=1", "subtree": "/earth/3dtiles/0-1-0/4/15/15.6.subtree",
    "png": "/earth/3/7/2.png?encoding=terrarium&size=512", "layer": "/earth/layer.json?fraction=0.25&extensions=octvertexnormals-watermask-metadata",
    "tileset": "/earth/tileset.json?error=2&error=2", "tilejson": "/earth/tiles.json?size=256", "datasets": "/datasets?v=1",
    "heights": "/earth/heights?locations=46.5,8.1%7C-90,180&datum=orthometric", "path": "/earth/heights?path=0,0|0,1&step=100000",
    "samples": "/earth/heights?path=0,179|0,-179&samples=7", "mesh": "/earth/mesh?bbox=7,46,8,47&error=100", "viewer": "/viewer/app.js?x#y",
    "root": "/", "probe": "/livez?token=secret", "absolute": "HTTP://user@host:80/earth/0/0/0.terrain", "authority": "https://host?x",
    "escapes": "/%65arth/0/%30/0%2Eterrain?err%6Fr=%35", "dots": "/earth/../%2e%2e/etc/passwd", "nul": "/earth/%00/0/0.terrain",
    "tokens": "/earth/0/0/0.terrain?token=a&to%6ben=b&error=1e-300", "outside": "/earth/24/99999999/16777216.terrain",
}
QUERIES = {
    "error": "error=1e308&atleast=1", "fraction": "fraction=0.0000001", "both": "error=1&fraction=1", "repeated": "error=5&error=5.0",
    "empty": "&&=&a&=b", "extensions": "extensions=metadata&extensions=octvertexnormals&v=1&v=2", "heights": "size=512&encoding=mapbox",
    "escape": "%65rror=%31%2", "points": "locations= 46.5 , 8.1 |" + "1,2|" * 20 + "3,4", "path": "path=90,0|-90,0|0,180&step=1e6", "huge": "path=0,0|0,1&samples=18446744073709551616",
    "compression": "compression=quantized&texture=jpeg&error=nan", "datum": "locations=0,0&datum=ellipsoid&v=",
}
HEADERS = {
    "codings": "gzip;q=0.5, br;q=1.0, zstd, *;q=0", "accept": "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask,application/octet-stream;q=0.9,*/*;q=0.01",
    "etags": '"0123456789abcdef", W/"x,y", *', "for": "192.0.2.1, 10.0.0.1, [2001:db8::1]:443, unknown, ::ffff:10.0.0.2", "range": "2001:db8::/32",
    "forwarded": 'for="[2001:db8::17]:4711";proto=https;host="a.example:8443", for=192.0.2.60;by=_x', "host": "maps.example:443, evil", "escaped": 'for="a\\"b\\\\";host=a;;host=b',
}
GET = b"GET /livez HTTP/1.1\r\nHost: a\r\n\r\n"
SAME = b" HTTP/1.1\r\nHost: a\r\nAccept: */*\r\n\r\n"  # a header that is repeated
HTTP = {
    "get": GET, "pipeline": GET * 3, "blank": b"\r\n\r\n" + GET, "http10": b"GET / HTTP/1.0\r\n\r\n", "alive10": b"GET / HTTP/1.0\r\nConnection: keep-alive\r\n\r\n" + GET,
    "repeated": b"GET /a?token=x" + SAME + b"GET /b" + SAME + b"HEAD /c?d=%20" + SAME + b"GET /\x80" + SAME, "repeated-odd": b"GET /a" + SAME + b"GET  /b" + SAME,
    "repeated-form": b"GET /a" + SAME + b"GET http://a/b" + SAME + b"OPTIONS *" + SAME, "repeated-mark": b"GET /a" + SAME + b"GET /\"<>^`{|}\\#" + SAME,
    "repeated-close": b"GET /a HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n" * 2, "repeated-tail": b"GET /a" + SAME + b"GET /b HTTP/1.1\r\nX: y HTTP/1.1\r\nHost: a\r\nAccept: */*\r\n\r\n",
    "repeated-post": b"GET /a" + SAME + b"POST /b" + SAME + b"GET /c HTTP/1.0" + SAME[9:], "close": b"GET / HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n" + GET, "head": b"HEAD /datasets HTTP/1.1\r\nhost:a\r\nAccept: a\r\nAccept: b\r\nIf-None-Match: \"x\"\r\n\r\n",
    "post": b"POST /earth/heights HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\nContent-Length: 20\r\n\r\n{\"locations\": \"1,2\"}" + GET,
    "expect": b"POST /earth/heights HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 3\r\n\r\nabc", "zero": b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 0\r\n\r\n" + GET,
    "chunked": b"GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" + GET, "te-gzip": b"GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: gzip\r\n\r\n" + GET,
    "get-body": b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 34\r\n\r\n" + GET, "two-lengths": b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\nabcd",
    "folded": b"GET / HTTP/1.1\r\nHost: a\r\nX: b\r\n Transfer-Encoding: chunked\r\n\r\n", "space": b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length : 3\r\n\r\nabc", "plus": b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: +3\r\n\r\nabc",
    "huge": b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 99999999999999999999\r\n\r\n", "lf": b"GET / HTTP/1.1\nHost: a\n\n", "two-hosts": b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
    "no-host": b"GET / HTTP/1.1\r\n\r\n", "token": b"GET /a?token=b&c HTTP/1.1\r\nHost: a\r\nAuthorization: Bearer xyz\r\nForwarded: for=1.2.3.4\r\nX-Forwarded-For: 1.2.3.4\r\n\r\n",
    "absolute": b"OPTIONS http://a/b HTTP/1.1\r\nHost: a:80\r\nOrigin: null\r\nReferer: http://a/?token=1\r\nUser-Agent: x\r\n\r\n", "tls": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", "preface": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "long-target": b"GET /" + b"a" * 8300 + b" HTTP/1.1\r\nHost: a\r\n\r\n", "long-head": b"GET / HTTP/1.1\r\nHost: a\r\n" + b"X: " + b"y" * 16400, "method": b"BREW / HTTP/1.1\r\nHost: a\r\n\r\n", "nul": b"GET / HTTP/1.1\r\nHost: a\r\nX: \x00\r\n\r\n",
}
HEIGHTS = {
    "one": '{"locations": "46.5,8.1"}', "many": '{"locations": "46.5,8.1|46.6,8.2|-90,-180", "datum": "orthometric"}', "path": '{"path": "0,0|0,1", "step": 50000}',
    "samples": '{"path": "0,179|0,-179|10,10", "samples": 5}', "real": '{"path": "0,0|0,1", "samples": 5.0}', "list": '{"locations": [1, 2]}', "repeated": '{"locations": "1,2", "locations": "3,4"}',
    "nested": '{"a": ' + "[" * 500 + "]" * 500 + "}", "number": '{"locations": 1e400}', "escapes": '{"loc\\u0061tions": "\\ud83d\\ude00,\\u0000"}', "array": "[]", "cut": '{"locations": "46.5,',
    "form": "locations=46.5%2C8.1%7C46.6,8.2&datum=ellipsoid", "form-plus": "locations=+46.5,+8.1", "form-path": "path=0,0|0,0&samples=2", "form-step": "path=0,0|90,0&step=1e-300", "form-empty": "", "form-same": "path=1,1|1,1&step=1",
    "form-many": "locations=" + "|".join(["1,1"] * 101), "poles": '{"path": "90,0|-90,0", "samples": 100}', "antipodes": '{"path": "0,0|0,180", "samples": 9}', "nan": "locations=nan,inf",
}


def configs():
    cases = json.loads((ROOT / "tests/config/cases.json").read_text(encoding="utf-8"))
    for number, config in enumerate(cases["accepted"]):
        yield f"accepted-{number:02}", json.dumps(config)
    for number, case in enumerate(cases["refused"][::3]):
        yield f"refused-{number:02}", json.dumps(case["config"])
    for name in ("minimal", "production"):
        yield name, (ROOT / f"config/examples/{name}.json").read_text(encoding="utf-8")
    yield "cut", '{"datasets": [{"name": "a", "sour'
    yield "deep", "[" * 1000
    yield "repeated", '{"listen": "a:1", "listen": "b:2"}'
    yield "no-utf8", b'{"listen": "\xff\xfe:1"}'
    yield "escaped", '{"datasets": [{"name": "a", "sources": ["\\u0000", "\\ud800"]}]}'


def write(target, seeds):
    folder = HERE / target
    folder.mkdir(exist_ok=True)
    for old in folder.glob("seed-*"):
        old.unlink()
    for name, text in seeds:
        (folder / f"seed-{name}").write_bytes(text if isinstance(text, bytes) else text.encode())


write("url_fuzz", [*URLS.items(), *((f"query-{name}", "?" + text) for name, text in QUERIES.items()),
                   *((f"header-{name}", ":" + text) for name, text in HEADERS.items())])
# The first bytes say where the rest is split.
write("http_fuzz", ((name, b"\x10\x00\x05\x00" + text) for name, text in HTTP.items()))
write("heights_fuzz", HEIGHTS.items())
write("config_fuzz", configs())
