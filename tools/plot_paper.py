#!/usr/bin/env python3
"""Draws the figures of a file that terrace_paper wrote as SVG, with logarithmic axes.

    tools/plot_paper.py PAPER.json FOLDER      FOLDER/ID.svg for each figure
"""
import html
import json
import math
import pathlib
import sys

WIDTH, HEIGHT = 720, 440
LEFT, RIGHT, TOP, BOTTOM = 70, 190, 40, 50
# Okabe and Ito's colours, distinguishable for colour-blind readers.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999")


class Axis:
    """A logarithmic axis of `values`, drawn between the pixels `start` and `end`; a label takes `room` pixels."""

    def __init__(self, values, start, end, room):
        self.low, self.high = math.log10(min(values)), math.log10(max(values))
        margin = max(0.03 * (self.high - self.low), 0.01)
        self.low, self.high = self.low - margin, self.high + margin
        self.start, self.end = start, end
        decade = abs(end - start) / (self.high - self.low)
        self.steps = (1, 2, 5) if decade * 0.3 >= room else (1,)  # from 1 to 2 is 0.3 of a decade

    def at(self, value):
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return round(self.start + share * (self.end - self.start), 1)

    def ticks(self):
        decades = range(math.floor(self.low), math.ceil(self.high) + 1)
        values = (step * 10.0**decade for decade in decades for step in self.steps)
        return [value for value in values if self.low <= math.log10(value) <= self.high]


def shown(value):
    return f"{value:,.0f}" if value >= 1 else f"{value:.6f}".rstrip("0")


def text(x, y, words, anchor="middle", extra=""):
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}"{extra}>{html.escape(words)}</text>'


def curve(series, x_axis, y_axis, colour):
    places = [(x_axis.at(x), y_axis.at(y)) for x, y in series["points"]]
    marks = [f'<circle cx="{x}" cy="{y}" r="3" fill="{"white" if series["reference"] else colour}" stroke="{colour}"/>'
             for x, y in places]
    line = f'<polyline points="{" ".join(f"{x},{y}" for x, y in places)}" fill="none" stroke="{colour}" stroke-width="1.6"/>'
    return ([] if series["reference"] else [line]) + (marks if len(places) < 60 else [])


def draw(figure):
    points = [point for series in figure["series"] for point in series["points"]]
    x_axis = Axis([x for x, _ in points], LEFT, WIDTH - RIGHT, 60)
    y_axis = Axis([y for _, y in points], HEIGHT - BOTTOM, TOP, 16)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
           'font-family="sans-serif" font-size="12">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
           text(LEFT, 22, figure["title"], "start", ' font-size="15"')]
    for value in x_axis.ticks():
        x = x_axis.at(value)
        out += [f'<path d="M{x} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>', text(x, HEIGHT - BOTTOM + 16, shown(value))]
    for value in y_axis.ticks():
        y = y_axis.at(value)
        out += [f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="#ddd"/>', text(LEFT - 6, y + 4, shown(value), "end")]
    out += [text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, figure["x"]),
            text(0, 0, figure["y"], extra=f' transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)"')]
    for number, series in enumerate(figure["series"]):
        colour = COLOURS[number % len(COLOURS)]
        out += curve(series, x_axis, y_axis, colour)
        y = TOP + 14 + 20 * number
        x = WIDTH - RIGHT + 14
        out += [f'<circle cx="{x + 10}" cy="{y - 4}" r="3" fill="white" stroke="{colour}"/>' if series["reference"] else
                f'<path d="M{x} {y - 4}h20" stroke="{colour}" stroke-width="2.5"/>',
                text(WIDTH - RIGHT + 40, y, series["name"], "start")]
    return "\n".join(out + ["</svg>\n"])


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for figure in json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))["figures"]:
        (folder / f"{figure['id']}.svg").write_text(draw(figure), encoding="utf-8")


if __name__ == "__main__":
    main()
