"""A server with fewer file descriptors than its disk cache has files (row 39)."""
import dataclasses
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import threading
import time
import urllib.request

import restarts

MB = 1 << 20
CLIENTS = 6


@dataclasses.dataclass
class Told:
    wrong: list  # replies that violate the promise
    files: int = 0  # of records, on disk
    most: int = 0  # largest number of open descriptors
    tables: int = 0  # of records among them
    requests: int = 0

    def __str__(self):
        return (f"{self.most} descriptors at most, {self.tables} of them for {self.files} files of records; {self.requests} requests, "
                f"{len(self.wrong)} failed")


class Watch:
    """Polls the open descriptors of a process."""

    def __init__(self, pid, told):
        self.pid, self.told, self.stop = pid, told, threading.Event()
        self.thread = threading.Thread(target=self.run)

    def run(self):
        while not self.stop.wait(0.01):
            names = []
            try:
                for entry in os.listdir(f"/proc/{self.pid}/fd"):
                    names.append(os.readlink(f"/proc/{self.pid}/fd/{entry}"))
            except OSError:
                continue  # it was closed meanwhile
            self.told.most = max(self.told.most, len(names))
            self.told.tables = max(self.told.tables, sum(name.endswith(".sst") for name in names))

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()


def targets(datasets):
    """Tiles at two errors each; with their refinements about 24 MB a dataset."""
    for dataset in datasets:
        for level, columns, rows in ((10, range(543, 546), range(717, 720)), (11, range(1087, 1092), range(1435, 1439))):
            for column in columns:
                for row in rows:
                    for error in (0.3, 1):
                        yield f"{dataset}/{level}/{column}/{row}.terrain?error={error}"


def ask_all(url, wanted, told):
    wanted, lock = iter(wanted), threading.Lock()

    def run():
        client = restarts.PatientClient(int(re.search(r":(\d+)/", url)[1]), 120)
        while True:
            with lock:
                target = next(wanted, None)
            if target is None:
                return client.close()
            try:
                status = client.ask("/" + target)
                problem = None if status == 200 else f"{target}: {status}"
            except (restarts.Lost, OSError) as error:
                problem = repr(error)
                client.close()
            with lock:
                told.requests += 1
                told.wrong += [problem] if problem else []

    threads = [threading.Thread(target=run) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def metric(url, name):
    """Values of the metric; nothing if there is no reply."""
    try:
        with urllib.request.urlopen(url + "metrics", timeout=30) as reply:
            return [float(value) for value in re.findall(rf"^{name}(?:{{.*}})? (\S+)$", reply.read().decode(), re.M)]
    except OSError:
        return []


def serve_with_few(binary, source_dir, folder, limit):
    """Fills the two stores while a reload adds datasets; then starts again with full stores."""
    told = Told([])
    names = ["a", "b", "c", "d"]
    for name in names:
        shutil.copy(source_dir / "config/samples/jacksboro.tif", folder / f"{name}.tif")
    config = folder / "terrace.json"

    def write(count):
        beside = folder / "beside.json"
        beside.write_text(json.dumps({
            # Datasets that differ only in their names would share their tiles.
            "datasets": [{"name": name, "sources": [f"{name}.tif"], "attribution": name} for name in names[:count]],
            "worker_threads": 2, "cache_bytes": 0,
            "refinement_cache_bytes": 0, "log_level": "warn",
            "disk_cache": {"directory": "cache", "tile_bytes": 256 * MB, "refinement_bytes": 256 * MB}}))
        beside.rename(config)

    for count in (2, len(names)):
        write(count)
        with open(folder / "log", "w+", encoding="utf-8") as log:
            process = subprocess.Popen([str(binary), "serve", "--config", str(config), "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                       stderr=log, text=True,
                                       preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit)))
            found = re.search(r"http://\S+/", process.stdout.readline())
            if not found:
                process.wait(60)
                told.wrong.append((folder / "log").read_text())
                process.stdout.close()
                return told
            with Watch(process.pid, told):
                ask_all(found[0], targets(names[:count]), told)
                if count < len(names):
                    write(len(names))
                    process.send_signal(signal.SIGHUP)
                    until = time.monotonic() + 60
                    while metric(found[0], "terrace_datasets") != [len(names)] and time.monotonic() < until:
                        time.sleep(0.1)
                    ask_all(found[0], targets(names), told)
                for name, wanted in (("terrace_cache_on", [1, 1, 1]), ("terrace_cache_errors_total", [0, 0, 0]), ("terrace_degraded", [0]),
                                     ("terrace_http_connections_refused_total", [0])):
                    if metric(found[0], name) != wanted:
                        told.wrong.append(f"{name} is {metric(found[0], name)}")
            process.terminate()
            process.stdout.close()
            if process.wait(60) != 0:
                told.wrong.append(f"ended with {process.returncode}")
            told.wrong += [line for line in (folder / "log").read_text().splitlines() if "oo many open files" in line]
    told.files = sum(1 for _ in folder.glob("cache/*/*.sst"))
    return told
