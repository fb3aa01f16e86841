"""What the tests of many bakers share: sources, an archive of a single process, a redis-server, workers."""
import concurrent.futures
import json
import resource
import shutil
import signal
import subprocess
import time
import unittest

from bake_case import BINARY, BakeCase
from redis_process import Redis

LEASE = 1.5  # seconds; the heartbeat is a third


@unittest.skipUnless(shutil.which("redis-server"), "redis-server is not installed")
class QueueCase(BakeCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.units = [unit["name"] for unit in json.loads((cls.reference / "manifest.json").read_text())["units"]]

    def setUp(self):
        self.redis = self.start_redis("redis")
        self.job = "test-job"

    def start_redis(self, name, *options):
        redis = Redis(self.scratch / f"{self.id().rpartition('.')[2]}-{name}", *options)
        self.addCleanup(redis.kill)
        return redis

    def command(self, place, *arguments, url=None, config=None, levels="0-11", lease=LEASE):
        return [str(part) for part in (
            BINARY, "bake", "--config", config or self.config, "--levels", levels, "--out", place, "--queue", url or self.redis.url,
            "--job", self.job, "--lease", lease, "--json", "--threads", 1, *arguments)]

    def start(self, place, *arguments, before=(), environment=None, limit=None, **options):
        return self.begin([*before, *self.command(place, *arguments, **options)], environment,
                          preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))))

    def joined(self, place, count, **options):
        """Workers that have all joined the job, each with a unit or about to take one."""
        workers = []
        for _ in range(count):
            worker = self.start(place, lease=20, **options)
            workers.append(worker)
            until = time.monotonic() + 60
            while f"-{worker.pid}-" not in str(self.redis("XINFO", "CONSUMERS", self.key("units"), "bakers")):
                self.assertLess(time.monotonic(), until)
                time.sleep(0.005)
            worker.send_signal(signal.SIGSTOP)
        for worker in workers:
            worker.send_signal(signal.SIGCONT)
        return workers

    def end(self, process, code=0):
        # Not communicate(): it would lose lines that a readline() before it has buffered.
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            texts = [pool.submit(stream.read) if stream else None for stream in (process.stdout, process.stderr)]
            try:
                process.wait(timeout=150)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
            out, errors = (text.result() if text else None for text in texts)
        self.assertEqual(process.returncode, code, errors)
        return out, errors

    def end_all(self, workers, code=0):
        """Reads all of them at once: a worker whose lines nobody reads stops, and the others wait for its unit."""
        with concurrent.futures.ThreadPoolExecutor(len(workers)) as pool:
            return list(pool.map(lambda worker: self.end(worker, code), workers))

    def run_bake(self, place, *arguments, code=0, **options):
        return self.end(self.start(place, *arguments, **options), code)

    def status(self, *arguments, code=0):
        done = subprocess.run([BINARY, "bake", "status", "--queue", self.redis.url, "--job", self.job, *arguments], text=True,
                              env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stdout

    def key(self, what):
        return f"terrace:{{{self.job}}}:{what}"

    def baked(self, *outputs, outcomes=("baked",)):
        """The units of the lines of --json, sorted, each as often as it was baked."""
        lines = [json.loads(line) for output in outputs for line in output.splitlines()]
        return sorted(line["unit"] for line in lines if "unit" in line and line["outcome"] in outcomes)
