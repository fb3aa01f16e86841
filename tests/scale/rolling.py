"""Rolling restarts, and a balancer that only asks /readyz, as that of Kubernetes."""
import asyncio
import contextlib
import http.client
import signal
import unittest

import cluster

PROBE_SECONDS = 0.2  # how often the balancer asks
DELAY_SECONDS = 1.0  # drain_delay_s behind it
MARK_SECONDS = 2.5  # longer than nginx avoids a node that failed: fail_timeout, in whole seconds


class Balancer:
    """Passes connections on to nodes that were ready when they were asked last. It repeats nothing, and closes nothing."""

    def __init__(self, nodes):
        self.nodes, self.ready, self.turn, self.port, self.tasks = nodes, set(), 0, cluster.free_port(), set()

    async def __aenter__(self):
        self.server = await asyncio.start_server(self.serve, "127.0.0.1", self.port)
        self.prober = asyncio.ensure_future(self.probe())
        return self

    async def __aexit__(self, *_):
        self.prober.cancel()
        self.server.close()

    @staticmethod
    def is_ready(port):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=2)
        try:
            connection.request("GET", "/readyz")
            return connection.getresponse().status == 200
        except (OSError, http.client.HTTPException):
            return False
        finally:
            connection.close()

    async def probe(self):
        while True:
            for node in self.nodes:
                is_ready = await asyncio.to_thread(self.is_ready, node.port)
                (self.ready.add if is_ready else self.ready.discard)(node.port)
            await asyncio.sleep(PROBE_SECONDS)

    async def wait_until_ready(self, node):
        while node.port not in self.ready:
            await asyncio.sleep(0.05)

    async def serve(self, reader, writer):
        ports = sorted(self.ready)
        self.turn += 1
        try:
            there, back = await asyncio.open_connection("127.0.0.1", ports[self.turn % len(ports)])
        except OSError:
            return writer.transport.abort()  # the client sees a refused connection
        await asyncio.gather(self.pump(reader, back), self.pump(there, writer))

    @staticmethod
    async def pump(reader, writer):
        try:
            while piece := await reader.read(1 << 16):
                writer.write(piece)
                await writer.drain()
        except OSError:
            pass
        with contextlib.suppress(OSError):
            writer.close()


class RollingTest(unittest.TestCase):
    """Has a folder, and starts three nodes of one dataset."""
    binary = None  # the program; set by the script

    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        self.stack, self.folder = stack, stack.enter_context(cluster.scratch())

    def nodes(self, **options):
        nodes = [cluster.Node(self.binary, self.folder, cluster.earth(), options) for _ in range(3)]
        for node in nodes:
            self.stack.callback(node.stop, signal.SIGKILL)
            node.start()
        return nodes


async def roll(nodes, rounds, balancer=None):
    """Restarts the nodes one after the other. Their exit statuses."""
    statuses = []
    for _ in range(rounds):
        for node in nodes:
            statuses.append(await asyncio.to_thread(node.stop))
            node.start(waits=False)
            await asyncio.to_thread(node.wait_until_served)
            if balancer:
                await balancer.wait_until_ready(node)
            else:
                await asyncio.sleep(MARK_SECONDS)
    return statuses
