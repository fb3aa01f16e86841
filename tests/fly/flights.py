"""Flights with `terrace fly` over a server of the sample, for tests whose arguments are BINARY SOURCE_DIR."""
import json
import os
import pathlib
import re
import subprocess
import sys
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import fault_proxy  # noqa: E402
import in_parallel  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()

DEM = SOURCE_DIR / "config/samples/jacksboro.tif"
WAY = ["--from", "-84.25,36.25,2500", "--to", "-84.25,36.35,2500", "--speed", "400"]


def start_server():
    global SERVER, UPSTREAM
    SERVER = subprocess.Popen([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--log-level", "error"], stdout=subprocess.PIPE, text=True)
    UPSTREAM = re.search(r"http://([\d.:]+)/", SERVER.stdout.readline())[1]
    urllib.request.urlopen(f"http://{UPSTREAM}/jacksboro/layer.json", timeout=60).read()


def stop_server():
    SERVER.terminate()
    SERVER.stdout.close()
    SERVER.wait(60)


def main():
    """Runs the tests of the program over one server."""
    start_server()
    try:
        in_parallel.main()
    finally:
        stop_server()


def fly(address, *options, path="jacksboro", way=WAY, duration="2"):
    """(exit status, report)"""
    done = subprocess.run([BINARY, "fly", f"http://{address}/{path}", *way, "--duration", duration, "--json", *options],
                          capture_output=True, text=True, timeout=120, check=False)
    if not done.stdout:
        return done.returncode, done.stderr
    return done.returncode, json.loads(done.stdout)


def fly_with_fault(fault, *options, **more):
    with fault_proxy.FaultProxy(UPSTREAM, fault) as proxy:
        status, report = fly(proxy.address, *options, **more)
    return status, report["summary"]


class Configured:
    """A server with a configuration of its own, its output closed at the end."""

    def __init__(self, folder, configuration):
        path = pathlib.Path(folder, "terrace.json")
        path.write_text(json.dumps({"listen": "127.0.0.1:0", **configuration}), encoding="utf-8")
        self.process = subprocess.Popen([BINARY, "serve", "--config", path, "--log-level", "error"], stdout=subprocess.PIPE, text=True)
        self.port = int(re.search(r"https?://[\d.]+:(\d+)/", self.process.stdout.readline())[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.stdout.close()
        self.process.wait(60)


def fly_to(url, *options, environment=None, way=WAY, duration="2"):
    done = subprocess.run([BINARY, "fly", url, *way, "--duration", duration, "--json", *options], capture_output=True, text=True,
                          timeout=120, check=False, env={**os.environ, **(environment or {})})
    return done.returncode, json.loads(done.stdout)["summary"] if done.stdout else done.stderr
