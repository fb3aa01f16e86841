#!/usr/bin/env python3
"""Simulates 1 to 100 nodes behind a ring, and checks the model against three real processes.

    tests/scale/simulate.py measure BINARY            service times of this machine, into tests/scale/service_times.json
    tests/scale/simulate.py check BINARY [--json F]   the same requests to the model and to three processes; prints both
    tests/scale/simulate.py plot FOLDER               plots of the model (python3-matplotlib)

The processor's name stands in service_times.json; docs/fleet.md has the results.
"""
import argparse
import asyncio
import json
import pathlib
import random
import re
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402
import model  # noqa: E402

TIMES = pathlib.Path(__file__).resolve().with_name("service_times.json")


def processor():
    found = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    return found[1] if found else "unknown"


def measured():
    return json.loads(TIMES.read_text())


async def timed(client, target):
    begun = time.perf_counter()
    status, fields, body = await client.get(target)
    assert status == 200, target
    return time.perf_counter() - begun, fields, body


def measure(binary):
    """Builds one at a time, then the same tiles from disk (a new process) and from memory."""
    targets = [target.replace(".terrain", ".glb") for level in (4, 5, 6, 7) for target in cluster.tiles(250, level)]
    with cluster.scratch() as folder:
        options = {"disk_cache": {"directory": str(folder / "disk")}, "worker_threads": 1}
        node = cluster.Node(binary, folder, cluster.earth(), options).start()

        async def draw():
            client, builds, seconds, sizes = cluster.Client(node.port, is_tls=False), [], [], []
            for target in targets:
                took, fields, body = await timed(client, target)
                stages = dict(re.findall(r"(\w+);dur=([\d.]+)", fields.get("server-timing", "")))
                builds.append(sum(float(ms) for stage, ms in stages.items() if stage not in ("queue", "cache", "total")) / 1000)
                seconds.append(took)
                sizes.append(len(body))
            client.close()
            return builds, seconds, sizes
        builds, _, sizes = asyncio.run(draw())
        node.stop()
        node.start()
        disk = asyncio.run(draw())[1]
        hit = asyncio.run(draw())[1]
        node.stop()
    TIMES.write_text(json.dumps({"processor": processor(), "hit_s": statistics.median(hit), "disk_s": statistics.median(disk),
                                 "mean_tile_bytes": statistics.mean(sizes), "builds_s": sorted(round(b, 6) for b in builds)[::5]}) + "\n")
    print(f"hit {statistics.median(hit) * 1e3:.2f} ms, disk {statistics.median(disk) * 1e3:.2f} ms, build p50 "
          f"{statistics.median(builds) * 1e3:.2f} ms, p99 {model.percentile(builds, 0.99) * 1e3:.2f} ms")


def check_requests(rate, seconds):
    """Of the dataset earth: levels 4 to 6 around places by Zipf's law."""
    chance = random.Random(3)
    spots = [(level, chance.randrange(2 ** (level + 1)), chance.randrange(2 ** level)) for level in (4, 5, 6) for _ in range(700)]
    chance.shuffle(spots)
    weights = [1 / (k + 1) ** 0.7 for k in range(len(spots))]
    now = 0.0
    while (now := now + chance.expovariate(rate)) < seconds:
        yield now, chance.choices(spots, weights)[0]


def check(binary, path, rate=80, seconds=45, capacity=400):
    """Three nodes with small caches; the second is killed at a third of the time and comes back at two thirds."""
    times, third = measured(), seconds / 3
    overhead = 640 + 700  # bytes of an entry besides the tile: ByteCache::kEntryOverheadBytes and the head
    requests = list(check_requests(rate, seconds))
    fleet = model.Fleet(3, 1, capacity, model.Times(times))
    changes = [(third, lambda f: f.lose(1)), (2 * third, lambda f: f.add(1))]
    simulated = list(fleet.run(requests, changes))
    with cluster.scratch() as folder:
        nodes = {i: cluster.Node(binary, folder, cluster.earth(), {"cache_bytes": int(capacity * (times["mean_tile_bytes"] + overhead)),
                                                                     "refinement_cache_bytes": 0, "worker_threads": 1}).start() for i in range(3)}
        real = asyncio.run(replay(nodes, requests, third))
        for node in nodes.values():
            node.stop()
    report = {}
    for name, replies in (("model", simulated), ("processes", real)):
        for part, begin in (("three nodes", third / 2), ("two nodes", third), ("three again", 2 * third)):
            end = begin + (third / 2 if part == "three nodes" else third)
            rows = [r for r in replies if begin <= r[0] < end]
            builds = sum(r[2] == "build" for r in rows)
            report[f"{name}, {part}"] = {"requests": len(rows), "hit ratio": round(1 - builds / len(rows), 3), "builds a second": round(builds / (end - begin), 1),
                                         "p50 ms": round(model.percentile([r[1] for r in rows], 0.5) * 1e3, 2), "p99 ms": round(model.percentile([r[1] for r in rows], 0.99) * 1e3, 2)}
    for name, row in report.items():
        print(f"{name:26} " + ", ".join(f"{key} {value}" for key, value in row.items()))
    if path:
        pathlib.Path(path).write_text(json.dumps(report, indent=1) + "\n")


async def replay(nodes, requests, third):
    """Sends each request at its time to the node that the ring of the model gives."""
    rings = {True: model.Ring(nodes), False: model.Ring([i for i in nodes if i != 1])}
    clients = {i: [cluster.Client(node.port, is_tls=False) for _ in range(8)] for i, node in nodes.items()}
    replies, tasks, is_whole, step, begun = [], [], True, 0, time.perf_counter()

    async def send(at, node, key):
        client = clients[node].pop() if clients[node] else cluster.Client(nodes[node].port, is_tls=False)
        level, x, y = key
        try:
            seconds, fields, _ = await timed(client, f"/earth/{level}/{x}/{y}.glb")
            what = re.search(r"cache;desc=(\w+)", fields.get("server-timing", ""))
            replies.append((at, seconds, "build" if what and what[1] == "miss" else "hit", node))
            clients[node].append(client)
        except cluster.Failed:
            pass  # cut by the kill

    for at, key in requests:
        if step < 2 and at >= (step + 1) * third:
            step += 1
            is_whole = step == 2
            if is_whole:
                await asyncio.to_thread(nodes[1].start)
                begun = time.perf_counter() - at  # the start takes no time in the model
            else:
                nodes[1].stop(9)
                clients[1].clear()
        await asyncio.sleep(max(0.0, begun + at - time.perf_counter()))
        tasks.append(asyncio.ensure_future(send(at, rings[is_whole].node_of(key), key)))
    await asyncio.gather(*tasks)
    return sorted(replies)


def plot(folder):
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "terrace"
    from matplotlib import pyplot
    times, folder = model.Times(measured()), pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    counts, capacity, rate, seconds = [1, 2, 3, 5, 10, 20, 50, 100], 4_000, 1000, 80
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.6))
    for has_ring, label in ((True, "ring"), (False, "any node")):
        rows = []
        for count in counts:
            fleet = model.Fleet(count, 2, capacity, times, has_ring=has_ring)
            replies = [r for r in fleet.run(model.mixed(rate, seconds)) if r[0] > seconds / 2]
            builds = sum(r[2] == "build" for r in replies)
            rows.append((1 - builds / len(replies), model.percentile([r[1] for r in replies], 0.99) * 1e3, builds / (seconds / 2)))
            print("{:9} {:3} nodes: hit ratio {:.3f}, p99 {:.1f} ms, {:.0f} builds/s".format(label, count, *rows[-1]))
        for axis, column, title in zip(axes, range(3), ("hit ratio", "p99, ms", "builds a second, all nodes")):
            axis.plot(counts, [row[column] for row in rows], marker="o", label=label)
            axis.set(title=title, xlabel="nodes", xscale="log", yscale="log" if column == 1 else "linear")
    axes[0].legend()
    axes[0].set_ylim(0, 1)
    figure.suptitle(f"{rate} requests a second in all, half Zipf and half flights; 2 workers and {capacity} tiles in memory a node")
    save(figure, folder / "fleet-size.svg")
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.6))
    for count in (3, 10):
        fleet = model.Fleet(count, 2, capacity, times)
        changes = [(60, lambda f: f.lose(1)), (120, lambda f: f.add(1))]
        changes += [(180 + 2 * i, lambda f, i=i: f.change_data(i)) for i in range(count)]
        rows = model.by_second(fleet.run(model.mixed(rate / 2, 240), changes), step=2.0)
        for at in (56, 62, 116, 122, 176, 178 + 2 * count, 230):
            row = rows[at // 2]
            print("{:3} nodes, {:3.0f} s: hit ratio {:.3f}, p99 {:.1f} ms, {:.0f} builds/s".format(count, row[0], row[2], row[3] * 1e3, row[4]))
        for axis, column, title, scale in zip(axes, (2, 3, 4), ("hit ratio", "p99, ms", "builds a second, all nodes"), (1, 1e3, 1)):
            axis.plot([row[0] for row in rows], [row[column] * scale for row in rows], label=f"{count} nodes")
            axis.set(title=title, xlabel="s")
    for axis in axes:
        for at, word in ((60, "loss"), (120, "return"), (180, "data")):
            axis.axvline(at, color="grey", linewidth=0.6)
            axis.annotate(word, (at, axis.get_ylim()[1]), fontsize=7, ha="center")
    axes[0].legend()
    figure.suptitle(f"{rate // 2} requests a second; a node is lost at 60 s, comes back empty at 120 s; data change node by node from 180 s")
    save(figure, folder / "fleet-events.svg")


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    path.write_text("\n".join(line.rstrip() for line in path.read_text().splitlines()) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("measure", "check", "plot"))
    parser.add_argument("where", help="the binary, or the folder of the plots")
    parser.add_argument("--json", help="where `check` writes its figures")
    arguments = parser.parse_args()
    if arguments.what == "measure":
        measure(arguments.where)
    elif arguments.what == "check":
        check(arguments.where, arguments.json)
    else:
        plot(arguments.where)


if __name__ == "__main__":
    main()
