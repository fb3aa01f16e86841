"""Floods of one client beside single requests of another, and hundreds of waiting connections (rows 37, 38 and 42).

A trusted proxy's header names the client of each request: start the server with --trusted-proxies 127.0.0.1.
"""
import contextlib
import http.client
import itertools
import json
import socket
import threading
import time

LEVEL = 13
FLOOD, POLITE = "X-Forwarded-For: 192.0.2.1\r\n", "X-Forwarded-For: 192.0.2.2\r\n"
POINTS = "|".join(f"{36.2 + i * 1e-4:.4f},{-84.2 + i * 1e-4:.4f}" for i in range(300))


def cold_tiles(dataset, longitude, latitude, level=LEVEL):
    """Distinct tiles around a place, nearest first by rings of columns and rows."""
    width = 180 / 2 ** level
    column, row = int((180 + longitude) / width), int((90 + latitude) / width)
    for ring in itertools.count():
        for dx, dy in itertools.product(range(-ring, ring + 1), repeat=2):
            if max(abs(dx), abs(dy)) == ring:
                yield f"/{dataset}/{level}/{column + dx}/{row + dy}.terrain"


def get(target, who):
    return f"GET {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n{who}\r\n".encode()


def post(body, who, length=None):
    return (f"POST /jacksboro/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n{who}"
            f"Content-Length: {length or len(body)}\r\n\r\n{body}").encode()


def status_of(port, message, timeout=120):
    """Sends a request on a new connection and reads the whole reply. Returns its status, 0 if there was no reply."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout) as connection:
            connection.sendall(message)
            reply = http.client.HTTPResponse(connection)
            reply.begin()
            reply.read()
            return reply.status
    except (OSError, http.client.HTTPException):
        return 0


def patient(port, connections, tiles_each, targets):
    """Opens connections in parallel, each of which requests cold tiles one by one: {status: count}, and seconds of the slowest."""
    statuses, lock, slowest = {}, threading.Lock(), [0]

    def run(targets):
        for target in targets:
            begun = time.monotonic()
            status = status_of(port, get(target, POLITE))
            with lock:
                statuses[status] = statuses.get(status, 0) + 1
                slowest[0] = max(slowest[0], time.monotonic() - begun)

    threads = [threading.Thread(target=run, args=(list(itertools.islice(targets, tiles_each)),)) for _ in range(connections)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return statuses, slowest[0]


@contextlib.contextmanager
def repeated(port, count, message):
    """Connections that repeat a request until the end, where they are cut off."""
    stop, sockets, lock = threading.Event(), set(), threading.Lock()

    def run():
        while not stop.is_set():
            with contextlib.suppress(OSError):
                connection = socket.create_connection(("127.0.0.1", port), 60)
                with lock:
                    sockets.add(connection)
                connection.sendall(message)
                while connection.recv(65536) and not stop.is_set():
                    pass
                with lock:
                    sockets.discard(connection)
                connection.close()

    threads = [threading.Thread(target=run) for _ in range(count)]
    for thread in threads:
        thread.start()
    time.sleep(1)
    try:
        yield
    finally:
        stop.set()
        with lock:
            for connection in sockets:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join(20)


@contextlib.contextmanager
def trickled(port, count):
    """Uploads that have sent 20 kB of 640, and send a little more ten times a second."""
    stop, connections = threading.Event(), []
    for _ in range(count):
        connection = socket.create_connection(("127.0.0.1", port), 10)
        connection.sendall(post(" " * 20_000, FLOOD, 640_000))
        connections.append(connection)

    def run():
        while not stop.wait(0.1):
            for connection in connections:
                with contextlib.suppress(OSError):
                    connection.send(b" " * 600, socket.MSG_DONTWAIT)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        for connection in connections:
            connection.close()


def floods(port):
    """For each flood, the single requests of other clients that failed because of it."""
    mesh = "/jacksboro/mesh?bbox=-84.4,36.1,-84.1,36.4&error=1"
    body = json.dumps({"locations": POINTS})
    tiles = cold_tiles("jacksboro", -84.25, 36.3)
    polite = {
        "tile": lambda: get(next(tiles), POLITE),
        "mesh": lambda: get("/jacksboro/mesh?bbox=-84.3,36.2,-84.29,36.21&error=20", POLITE),
        "heights": lambda: get("/jacksboro/heights?locations=36.3,-84.25", POLITE),
        "upload": lambda: post(body + " " * 500_000, POLITE),
    }
    return {"12 meshes": repeated(port, 12, get(mesh, FLOOD)), "60 uploads": trickled(port, 60),
            "300 heights": repeated(port, 300, get(f"/jacksboro/heights?locations={POINTS}", FLOOD))}, polite


def beside(flood, polite, port, times):
    """{kind: {status: count}} of the single requests during the flood."""
    statuses = {}
    with flood:
        for _ in range(times):
            for kind, message in polite.items():
                status = status_of(port, message())
                statuses.setdefault(kind, {}).setdefault(status, 0)
                statuses[kind][status] += 1
    return statuses


def leave(port, count, at_once):
    """Sends complete uploads of 600 kB and disconnects. Each requests so many heights that a worker takes a while."""
    body = json.dumps({"locations": "|".join(f"{36.2 + i * 2e-5:.5f},{-84.4 + i * 3e-5:.5f}" for i in range(9000))})
    message = post(body + " " * (600_000 - len(body)), FLOOD)

    def run():
        for _ in range(count // at_once):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 2) as connection:
                connection.settimeout(1)
                connection.sendall(message)

    threads = [threading.Thread(target=run) for _ in range(at_once)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
