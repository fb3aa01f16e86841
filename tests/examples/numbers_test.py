"""Runs the examples of heights as numbers: numbers_test.py BINARY_HEIGHTS TERRACE SOURCE_DIR.

The scripts that draw need matplotlib; without it they are skipped.
"""
import importlib.util
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading

client, terrace, source = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout


def complaint(*arguments, reply=None):
    """(exit status, message) of the C++ example; a server at the port PORT reads a request and sends `reply`."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        def answer():
            connection, _ = listener.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(reply)

        port = str(listener.getsockname()[1])
        if reply is None:
            listener.close()
        else:
            threading.Thread(target=answer, daemon=True).start()
        done = subprocess.run([client, *(port if part == "PORT" else part for part in arguments)], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stderr


assert complaint()[0] == 2 and "HOST PORT PATH" in complaint()[1]
assert complaint("127.0.0.1", "PORT", "/x")[0] == 1 and "refused" in complaint("127.0.0.1", "PORT", "/x")[1]
for sent in (b"", b"HTTP", b"\r\n\r\n", b"HTTP/1.1 200 OK\r\n\r\n", b"HTTP/1.1 200 OK\r\n\r\n1234567", b"HTTP/1.1 404 Not Found\r\n\r\n12345678"):
    status, said = complaint("127.0.0.1", "PORT", "/x", reply=sent)
    assert status == 1 and said.startswith("no heights, but"), (sent, status, said)

server = subprocess.Popen([terrace, "serve", "--config", source / "config/samples/samples.json", "--listen", "127.0.0.1:0"],
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
try:
    port = re.search(r":(\d+)", server.stdout.readline()).group(1)
    dataset = f"http://127.0.0.1:{port}/jacksboro"
    in_cpp = run(client, "localhost", port, "/jacksboro/heights").split()
    in_python = run(sys.executable, source / "examples/binary_heights.py", dataset, "-84.2,36.3", "-84.1,36.4")
    assert in_cpp == re.findall(r"([0-9.]+) m", in_python) == ["375.000", "379.000"], (in_cpp, in_python)
    if importlib.util.find_spec("matplotlib"):
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder) / "picture.png"
            for script, *arguments in (("drive.py", "36.25,-84.35", "36.3,-84.3"), ("view_map.py", "36.3,-84.25", "10", "0.05", "41")):
                run(sys.executable, source / "examples" / script, dataset, picture, *arguments)
                assert picture.read_bytes().startswith(b"\x89PNG"), script
                picture.unlink()
            said = run(sys.executable, source / "examples/view_map.py", dataset, picture, "36.44,-84.4", "10", "0.05", "41")
            seen, hidden, unknown = map(int, re.findall(r"\d+", said))
            # 61 % of the columns and 56 % of the rows of the map are on the data: the rest is unknown, not seen.
            assert seen + hidden + unknown == 41 * 41 and seen > 0 and unknown > 41 * 41 / 2, said
    else:
        print("SKIPPED in part: drive.py and view_map.py need matplotlib")
finally:
    server.send_signal(signal.SIGTERM)
    server.wait(timeout=60)
