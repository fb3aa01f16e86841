#!/usr/bin/env python3
"""Draws the memory that tests/reliability/soak.py --samples measured, as SVG.

    tools/plot_soak.py SAMPLES.json FILE.svg
"""
import json
import pathlib
import sys

from plot_paper import BOTTOM, COLOURS, HEIGHT, LEFT, RIGHT, TOP, WIDTH, text

SERIES = (("rss", "RSS of the process"), ("used", "the cgroup, all"), ("anonymous", "its processes' memory"), ("file", "its pages of files"))


def draw(soak):
    samples, limit, bound = soak["samples"], soak["limit_mb"], soak["bound_mb"]
    until = max(samples[-1]["seconds"], 1)

    def place(seconds, megabytes):
        x = LEFT + seconds / until * (WIDTH - RIGHT - LEFT)
        y = HEIGHT - BOTTOM - megabytes / (1.05 * limit) * (HEIGHT - BOTTOM - TOP)
        return round(x, 1), round(y, 1)

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
           'font-family="sans-serif" font-size="12">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
           text(LEFT, 22, f"Memory under mixed traffic, {samples[-1]['requests']:,} requests", "start", ' font-size="15"')]
    step = next(step for step in (10, 30, 60, 300, 600, 3600) if until / step <= 12)
    for seconds in range(0, int(until) + step // 2, step):
        x, bottom = place(seconds, 0)
        if x <= WIDTH - RIGHT:
            out += [f'<path d="M{x} {TOP}V{bottom}" stroke="#ddd"/>', text(x, bottom + 16, f"{seconds / 60:g}")]
    for megabytes in range(0, int(limit) + 1, 64):
        y = place(0, megabytes)[1]
        out += [f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="#ddd"/>', text(LEFT - 6, y + 4, str(megabytes), "end")]
    out += [text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, "minutes"),
            text(0, 0, "MB", extra=f' transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)"')]
    for megabytes, words in ((limit, "limit of the cgroup"), (bound, "caches + 128 MB")):
        y = place(0, megabytes)[1]
        out += [f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="#444" stroke-dasharray="6 4"/>',
                text(WIDTH - RIGHT + 10, y + 4, f"{words}, {megabytes:g}", "start")]
    known = [(key, words) for key, words in SERIES if key in samples[0]]
    for number, (key, words) in enumerate(known):
        points = " ".join(f"{x},{y}" for x, y in (place(sample["seconds"], sample[key]) for sample in samples))
        y = HEIGHT - BOTTOM - 100 + 20 * number
        out += [f'<polyline points="{points}" fill="none" stroke="{COLOURS[number]}" stroke-width="1.6"/>',
                f'<path d="M{WIDTH - RIGHT + 10} {y - 4}h20" stroke="{COLOURS[number]}" stroke-width="2.5"/>',
                text(WIDTH - RIGHT + 36, y, words, "start")]
    return "\n".join(out + ["</svg>\n"])


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    soak = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    pathlib.Path(sys.argv[2]).write_text(draw(soak), encoding="utf-8")


if __name__ == "__main__":
    main()
