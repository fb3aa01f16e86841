"""The tier that servers share, with a real redis-server that is dead, frozen, slow, lying, full and more (rows 29 and 49 of
docs/reliability.md): shared_cache_test.py BINARY SOURCE_DIR.

TERRACE_LONG_TESTS=1: 10,000 replies for each fault. Skipped (exit code 77) without redis-server.
"""
import asyncio
import contextlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import cluster  # noqa: E402
import in_parallel  # noqa: E402
from redis_process import Proxy, Redis  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
sys.argv.pop(1)
IS_LONG = os.environ.get("TERRACE_LONG_TESTS") == "1"
TILES = 60
ROUNDS = 10_000 // TILES if IS_LONG else 20
WORKERS = 2
RETRY_SECONDS = 1  # SharedStoreOptions::retry_after
PASSWORD = "a-password-that-no-log-may-have"


class SharedCache(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """What a server without any cache sends: the truth."""
        cls.targets = cluster.tiles(TILES)
        with cluster.scratch() as folder:
            node = cluster.Node(BINARY, folder, cluster.earth()).start()
            cls.truth = cls.bodies_of(node)
            node.stop()

    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        self.stack, self.folder, self.begun = stack, stack.enter_context(cluster.scratch()), time.monotonic()

    @classmethod
    def bodies_of(cls, node, targets=None):
        seen = {}

        async def draw():
            client = cluster.Client(node.port, is_tls=False)
            for target in targets or cls.targets:
                status, _, body = await client.get(target)
                seen[target] = (status, body)
            client.close()
        asyncio.run(draw())
        return seen

    def redis(self, *options):
        redis = Redis(self.folder, *options).start()
        self.stack.callback(redis.stop)
        return redis

    def proxy(self, redis):
        proxy = Proxy(redis.port)
        self.stack.callback(proxy.close)
        return proxy

    def node(self, port, environment=None, waits=True, scheme="redis", **options):
        """Without a cache in memory, so that every request asks Redis. On a busy machine the default time-out passes now and then."""
        shared = {"url": f"{scheme}://127.0.0.1:{port}/0", "min_build_ms": 0, "timeout_ms": 1000, **options}
        node = cluster.Node(BINARY, self.folder, cluster.earth(),
                            {"shared_cache": shared, "cache_bytes": 0, "worker_threads": WORKERS, "admin_listen": f"127.0.0.1:{cluster.free_port()}"},
                            environment)
        self.stack.callback(node.stop, signal.SIGKILL)
        node.start()
        if waits:
            self.wait_until_on(node)
        return node

    def figure(self, node, name):
        return cluster.sum_of(node.metrics(), f"terrace_cache_{name}", 'tier="shared"')

    def wait_for(self, condition, what, seconds=30):
        end = time.monotonic() + seconds
        while not condition():
            self.assertLess(time.monotonic(), end, what)
            time.sleep(0.05)

    def wait_until_on(self, node, on=1):
        self.wait_for(lambda: self.figure(node, "on") == on, f"the tier does not become {on}")

    def fill(self, redis, node):
        def is_full():
            self.assertEqual(self.bodies_of(node), self.truth)
            time.sleep(0.2)
            return len(redis.keys()) == TILES
        self.wait_for(is_full, "tiles are not written", 60)
        # The later rounds have built some tiles again.
        self.wait_for(lambda: sum(self.figure(node, name) for name in ("written_total", "dropped_total"))
                      >= node.sum_of("terrace_tile_builds_total"), "tiles are not written")

    def draw(self, node, fault=None):
        """Many replies, with a fault in the middle: each must be right. Prints the times, asserts none."""
        seen, targets = cluster.Seen(), self.targets * ROUNDS
        for target, (_, body) in self.truth.items():
            seen.add(target, target, 200, body)
        seen.milliseconds.clear()

        async def run():
            await cluster.draw(node.port, WORKERS, self.targets, seen, is_tls=False)
            draw = asyncio.ensure_future(cluster.draw(node.port, WORKERS, targets, seen, is_tls=False))
            await asyncio.sleep(0.02)
            if fault:
                await asyncio.to_thread(fault)
            await draw
            await cluster.draw(node.port, WORKERS, self.targets, seen, is_tls=False)
            await asyncio.sleep(1.1)  # how long a text of /metrics is reused
        asyncio.run(run())
        self.assertEqual(seen.failures[:5], [])
        self.assertEqual(seen.wrong[:5], [])
        times = sorted(seen.milliseconds)
        print(f"\n{self.id().rpartition('.')[2]}: {len(times)} replies, p50 {times[len(times) // 2]:.1f} ms, "
              f"p99 {times[len(times) * 99 // 100]:.1f} ms, {int(self.figure(node, 'timeouts_total'))} time-outs")

    def check_time_outs(self, node):
        """A fault costs each worker, and the tier's own thread, one time-out at most, whatever the number of requests, and the tier is not
        asked again within a second. Once it is off, nobody waits. The slower the machine is, the more is allowed."""
        def figures():
            time.sleep(1.1)  # how long a text of /metrics is reused
            metrics = node.metrics()
            return [cluster.sum_of(metrics, f"terrace_cache_{name}_total", 'tier="shared"') for name in ("switched_off", "timeouts", "skipped")]
        off, late, skipped = figures()
        self.assertGreater(off, 0)
        self.assertLessEqual(late, (WORKERS + 1) * off)
        self.assertLessEqual(off, 1 + (time.monotonic() - self.begun) / RETRY_SECONDS)
        self.assertGreater(skipped, TILES / 2, "no request waits while the tier is off")
        self.assertEqual(self.bodies_of(node), self.truth)
        off_then, late_then, skipped_then = figures()
        self.assertEqual(off_then, off)
        self.assertLessEqual(late_then - late, 1, "of a write that was on its way")
        self.assertGreaterEqual(skipped_then - skipped, TILES)

    def test_a_server_finds_what_another_has_built(self):
        redis = self.redis()
        first = self.node(redis.port)
        self.fill(redis, first)
        second = self.node(redis.port)
        self.assertEqual(self.bodies_of(second), self.truth)
        time.sleep(1.1)
        self.assertEqual(self.figure(second, "hits_total"), TILES)
        self.assertEqual(second.sum_of("terrace_tile_builds_total"), 0)

    def test_other_data_is_not_found(self):
        redis = self.redis()
        self.fill(redis, self.node(redis.port))
        other = cluster.Node(BINARY, self.folder, [{**cluster.earth()[0], "error_fraction": 0.25}],
                             {"shared_cache": {"url": f"redis://127.0.0.1:{redis.port}/0", "min_build_ms": 0}}).start()
        self.stack.callback(other.stop, signal.SIGKILL)
        self.wait_until_on(other)
        self.assertNotEqual(self.bodies_of(other), self.truth)
        time.sleep(1.1)
        self.assertEqual(self.figure(other, "hits_total"), 0)

    def test_dead(self):
        redis = self.redis()
        node = self.node(redis.port)
        self.fill(redis, node)
        self.draw(node, redis.stop)
        self.wait_until_on(node, 0)
        self.check_time_outs(node)
        redis.start()
        self.wait_until_on(node)
        self.fill(redis, node)

    def test_frozen(self):
        redis = self.redis()
        node = self.node(redis.port, timeout_ms=25)
        self.fill(redis, node)
        self.draw(node, lambda: redis.signal(signal.SIGSTOP))
        self.check_time_outs(node)
        self.assertGreater(self.figure(node, "timeouts_total"), 0)
        redis.signal(signal.SIGCONT)
        self.wait_until_on(node)

    def test_slow(self):
        redis = self.redis()
        proxy = self.proxy(redis)
        node = self.node(proxy.port, timeout_ms=25)
        self.fill(redis, node)
        self.draw(node, lambda: setattr(proxy, "delay", 1.0))
        self.check_time_outs(node)
        proxy.delay = 0.0
        self.wait_until_on(node)

    def test_lying(self):
        redis, chance = self.redis(), random.Random(1)
        proxy = self.proxy(redis)
        node = self.node(proxy.port)
        self.fill(redis, node)

        def flip(piece):
            if len(piece) < 100:
                return piece
            at, bit = chance.randrange(20, len(piece) - 2), 1 << chance.randrange(8)
            return piece[:at] + bytes([piece[at] ^ bit]) + piece[at + 1:]
        proxy.change = flip
        self.draw(node)

        def finds_damage():
            # A bit of a length ends the connection, and the tier is off for a while: perhaps for most of the draw above.
            self.assertEqual(self.bodies_of(node), self.truth)
            return self.figure(node, "damaged_total") > TILES
        self.wait_for(finds_damage, "nothing was found to be wrong")

    def test_replies_that_are_cut_or_of_another_protocol(self):
        redis = self.redis()
        proxy = self.proxy(redis)
        node = self.node(proxy.port)
        self.fill(redis, node)
        for change in (lambda piece: None if len(piece) > 100 else piece, lambda _: b"HTTP/1.1 400 Bad Request\r\n\r\n",
                       lambda _: b"*99999999\r\n", lambda _: b"$99999999999\r\n"):
            proxy.change = change
            self.draw(node)
            self.assertGreater(self.figure(node, "switched_off_total"), 0)
            proxy.change = lambda piece: piece
            self.wait_until_on(node)

    def test_values_of_other_keys_lengths_and_types(self):
        redis = self.redis()
        node = self.node(redis.port)
        self.fill(redis, node)
        keys = redis.keys()
        values = [redis.ask(b"GET", key) for key in keys]
        for i, key in enumerate(keys):
            wrong = [values[i - 1], values[i][:-1], values[i] + b"x", b"x", values[i] + bytes(1 << 20), bytes(len(values[i]))][i % 6]
            redis.ask(b"SET", key, wrong)
        redis.ask(b"DEL", keys[0])
        redis.ask(b"RPUSH", keys[0], b"a list")
        self.assertEqual(self.bodies_of(node), self.truth)
        longer = len(range(4, len(keys), 6))  # than this server keeps: another one may
        self.wait_for(lambda: self.figure(node, "damaged_total") == TILES - longer, "nothing was found to be wrong")
        self.assertEqual(self.figure(node, "switched_off_total"), 0, "a wrong value is a miss and nothing else")
        self.assertEqual(self.bodies_of(node), self.truth)
        self.wait_for(lambda: [redis.ask(b"GET", key) for key in keys] == values, "wrong values are not replaced")

    def test_full(self):
        redis = self.redis("--maxmemory-policy", "noeviction")
        node = self.node(redis.port)
        self.assertEqual(self.bodies_of(node, self.targets[:20]), {target: self.truth[target] for target in self.targets[:20]})
        self.wait_for(lambda: len(redis.keys()) == 20, "tiles are not written")
        redis.ask(b"CONFIG", b"SET", b"maxmemory", b"1")
        self.draw(node)
        self.assertGreater(self.figure(node, "hits_total"), 20)
        self.wait_for(lambda: self.figure(node, "dropped_total") > 0, "Redis is not full")
        self.assertIn("maxmemory", node.log())
        self.assertEqual(self.figure(node, "switched_off_total"), 0, "it is still read")
        self.assertLess(node.log().count("maxmemory"), 4, "the log is not flooded")

    def test_a_read_only_replica_is_read(self):
        primary = self.redis()
        self.fill(primary, self.node(primary.port))
        replica = self.redis("--replicaof", f"127.0.0.1 {primary.port}")
        self.wait_for(lambda: len(replica.keys()) == TILES, "the replica does not follow")
        node = self.node(replica.port)
        primary.ask(b"DEL", *primary.keys()[:10])
        self.wait_for(lambda: len(replica.keys()) == TILES - 10, "the replica does not follow")
        self.assertEqual(self.bodies_of(node), self.truth)
        self.wait_for(lambda: "replica" in node.log(), "the log does not say why nothing is written")
        time.sleep(1.1)
        self.assertEqual(self.figure(node, "hits_total"), TILES - 10)

    def test_absent_at_the_start(self):
        redis = Redis(self.folder)
        self.stack.callback(redis.stop)
        node = self.node(redis.port, waits=False)
        self.assertEqual(self.bodies_of(node), self.truth)
        self.assertIn("cannot be reached", node.log())
        redis.start()
        self.wait_until_on(node)
        self.fill(redis, node)

    def test_passwords(self):
        redis = self.redis("--requirepass", PASSWORD)
        file = self.folder / "password"
        file.write_text(PASSWORD + "\n")
        for environment, options in (({**os.environ, "TERRACE_SHARED_CACHE_PASSWORD": PASSWORD}, {}), (None, {"password_file": str(file)})):
            node = self.node(redis.port, environment, **options)
            printed = subprocess.run([BINARY, "serve", "--print-config", "--config", node.folder / "terrace.json"], check=True,
                                     stdout=subprocess.PIPE, text=True, env=environment).stdout
            self.assertNotIn(PASSWORD, printed + node.log())
        file.write_text(PASSWORD[:-1] + "\n")
        for options in ({"password_file": str(file)}, {}):
            node = self.node(redis.port, waits=False, **options)
            self.assertEqual(self.bodies_of(node), self.truth)
            self.wait_for(lambda: "password" in node.log(), "the log does not say why")
            self.assertNotIn(PASSWORD[:-1], node.log())
        refused = subprocess.run([BINARY, "serve", "--shared-cache", f"redis://u:{PASSWORD}@h:1/0", "--check-config",
                                  cluster.SAMPLES / "etopo5.tif"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("password_file", refused.stdout)
        self.assertNotIn(PASSWORD, refused.stdout)
        missing = subprocess.run([BINARY, "serve", "--config", self.config_with_no_password_file(redis.port)], stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, text=True)
        self.assertEqual(missing.returncode, 1)
        self.assertIn("no-such-file", missing.stdout)

    def config_with_no_password_file(self, port):
        path = self.folder / "wrong.json"
        path.write_text(json.dumps({"datasets": cluster.earth(), "shared_cache": {"url": f"redis://127.0.0.1:{port}",
                                                                                    "password_file": "no-such-file"}}))
        return path

    def test_tls(self):
        key, certificate = self.folder / "tls.key", self.folder / "tls.crt"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
                        "/CN=redis", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", certificate], check=True, stderr=subprocess.DEVNULL)
        redis = Redis(self.folder, "--port", "0", "--tls-cert-file", str(certificate), "--tls-key-file", str(key), "--tls-ca-cert-file",
                      str(certificate), "--tls-auth-clients", "no")
        self.stack.callback(redis.stop)
        redis.start("--tls-port")
        first = self.node(redis.port, scheme="rediss", ca_file=str(certificate))
        self.assertEqual(self.bodies_of(first), self.truth)
        self.wait_for(lambda: self.figure(first, "written_total") == TILES, "tiles are not written")
        self.assertEqual(self.bodies_of(first), self.truth)
        time.sleep(1.1)
        self.assertEqual(self.figure(first, "hits_total"), TILES)
        stranger = self.node(redis.port, scheme="rediss", waits=False)  # the system does not know the authority
        self.assertEqual(self.bodies_of(stranger), self.truth)
        self.wait_for(lambda: "not trusted" in stranger.log(), "the log does not say why")

    def test_large_and_cheap_tiles_are_not_sent(self):
        redis = self.redis()
        for options in ({"max_bytes_per_tile": 10}, {"min_build_ms": 60_000}):
            node = self.node(redis.port, **options)
            self.assertEqual(self.bodies_of(node), self.truth)
            time.sleep(0.3)
            self.assertEqual(redis.keys(), [])

    def test_a_lease_builds_a_tile_once(self):
        redis = self.redis()
        nodes = [self.node(redis.port, lease_ms=10_000) for _ in range(2)]
        seen = cluster.Seen()

        async def both():
            # From both ends, so that each node is the first to ask for some tiles.
            await asyncio.gather(*(cluster.draw(node.port, WORKERS, targets, seen, is_tls=False)
                                   for node, targets in zip(nodes, (self.targets, self.targets[::-1]))))
        asyncio.run(both())
        self.assertEqual((seen.failures, seen.wrong), ([], []))
        self.assertEqual(sum(node.sum_of("terrace_tile_builds_total") for node in nodes), TILES)
        self.assertGreater(min(node.sum_of("terrace_tile_builds_total") for node in nodes), 0)

    def test_a_lease_whose_owner_is_gone_ends(self):
        redis = self.redis()
        node = self.node(redis.port, lease_ms=300)
        self.fill(redis, node)
        keys = redis.keys()[:5]
        leases = [key.replace(b"terrace:tile:", b"terrace:lease:") for key in keys]
        for key, lease in zip(keys, leases):
            redis.ask(b"SET", lease, b"1")  # of nobody, and without an end
            redis.ask(b"DEL", key)
        self.assertEqual(self.bodies_of(node), self.truth)
        self.wait_for(lambda: len(redis.keys()) == TILES, "tiles are not written")
        time.sleep(0.2)
        self.assertEqual([redis.ask(b"GET", lease) for lease in leases], [b"1"] * 5, "a lease of another is released")

    def test_leases_that_are_always_held_cost_one_wait_now_and_then(self):
        redis = self.redis()
        proxy = self.proxy(redis)
        node = self.node(proxy.port, lease_ms=1000)
        monitor = self.stack.enter_context(socket.create_connection(("127.0.0.1", redis.port), 30))
        monitor.sendall(b"MONITOR\r\n")
        proxy.change = lambda piece: piece.replace(b"+OK\r\n", b"$-1\r\n")  # another holds the lease
        begun = time.monotonic()
        self.assertEqual(self.bodies_of(node), self.truth)
        waits = 1 + (time.monotonic() - begun) / 11  # after a wait of a second there are no leases for ten
        proxy.close()
        redis.stop()
        commands = b""
        with contextlib.suppress(ConnectionError):
            while piece := monitor.recv(1 << 16):
                commands += piece
        leases = set(re.findall(rb'"SET" "(terrace:lease:[^ ]*)', commands))
        self.assertGreater(len(leases), 0)
        self.assertLessEqual(len(leases), waits)

    def test_a_purge_erases_there_too(self):
        redis = self.redis()
        node = self.node(redis.port)
        self.fill(redis, node)
        redis.ask(b"SET", b"terrace:tile:of others", b"x")
        port = int(node.config["admin_listen"].rpartition(":")[2])
        reply = subprocess.run(["curl", "-s", "-X", "POST", f"http://127.0.0.1:{port}/admin/purge?dataset=earth"], check=True,
                               stdout=subprocess.PIPE).stdout
        self.assertEqual(json.loads(reply)["erased"]["tiles"]["shared"], TILES)
        self.assertEqual(redis.keys(), [b"terrace:tile:of others"])
        redis.stop()
        self.bodies_of(node)
        self.wait_until_on(node, 0)
        failed = subprocess.run(["curl", "-s", "-o", "/dev/null", "-w", "%{http_code}", "-X", "POST",
                                 f"http://127.0.0.1:{port}/admin/purge?dataset=earth"], check=True, stdout=subprocess.PIPE).stdout
        self.assertEqual(failed, b"503")

    def test_the_process_ends_while_redis_is_frozen(self):
        redis = self.redis()
        node = self.node(redis.port, timeout_ms=25)
        redis.signal(signal.SIGSTOP)
        self.assertEqual(self.bodies_of(node), self.truth)
        self.assertEqual(node.stop(), 0)
        redis.signal(signal.SIGCONT)


if __name__ == "__main__":
    if missing := [tool for tool in ("redis-server", "redis-cli", "openssl", "curl") if not shutil.which(tool)]:
        print(f"SKIPPED: shared_cache_test needs {', '.join(missing)}; tools/install_deps.sh --test installs it")
        sys.exit(77)
    in_parallel.main()
