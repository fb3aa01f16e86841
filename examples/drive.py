#!/usr/bin/env python3
"""A vehicle drives over the mesh that a client draws: drive.py http://127.0.0.1:8080/jacksboro OUT.png FROM TO [LEVEL [ERROR]]

FROM and TO are LAT,LON. The vehicle asks for its wheels along the whole way in one request, as a physics engine asks for the next second. The
picture shows its height on the drawn mesh and on the data, and how far a vehicle on the data would hover above the picture or sink into it.
"""
import json
import sys
import urllib.request

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot


def ask(dataset, query, points):
    body = json.dumps({"locations": "|".join(f"{lat:.9f},{lon:.9f}" for lat, lon in points)}).encode()
    request = urllib.request.Request(f"{dataset}/heights?{query}", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request) as reply:
        return json.load(reply)["results"]


def main(dataset, out, start, end, level="11", error="20"):
    (lat, lon), (lat_end, lon_end) = (map(float, text.split(",")) for text in (start, end))
    steps = 1500
    path = [(lat + (lat_end - lat) * i / steps, lon + (lon_end - lon) * i / steps) for i in range(steps + 1)]
    drawn = ask(dataset, f"surface=served&level={level}&error={error}&normals=1", path)
    data = ask(dataset, "surface=source", path)
    along = [100 * i / steps for i in range(steps + 1)]
    on_mesh, on_data = ([result["elevation"] for result in results] for results in (drawn, data))
    figure, (above, middle, below) = pyplot.subplots(3, 1, figsize=(10, 8), sharex=True, height_ratios=[3, 1.5, 1.5])
    above.plot(along, on_data, linewidth=0.8, color="0.5", label="surface=source")
    above.plot(along, on_mesh, linewidth=1.4, color="tab:red", label=f"surface=served, level {level}, error {error} m")
    above.set_ylabel("height of the vehicle, m")
    above.legend()
    middle.fill_between(along, [a - b if a is not None else 0 for a, b in zip(on_data, on_mesh)], linewidth=0)
    middle.set_ylabel("a vehicle on the data\nhovers (+) or sinks (-), m")
    below.plot(along, [result["slope"] for result in drawn], linewidth=0.8, color="tab:red")
    below.set_ylabel("slope under\nthe wheels, degrees")
    below.set_xlabel("way, %")
    figure.tight_layout()
    figure.savefig(out, dpi=90)


if __name__ == "__main__":
    main(*sys.argv[1:])
