#!/usr/bin/env python3
"""Writes examples/plot_tile.ipynb from examples/plot_tile.py, whose cells begin with "# %%": write_notebook.py [SCRIPT]

The docstring and the first line stay out of it. A test fails until the notebook is that of the script.
"""
import json
import pathlib
import re
import sys


def notebook(script):
    cells = []
    for kind, text in re.findall(r"^# %%( \[markdown\])?\n(.*?)(?=^# %%|\Z)", script, re.S | re.M):
        text = text.strip("\n")
        if kind:
            cells.append({"cell_type": "markdown", "metadata": {}, "source": re.sub(r"^# ?", "", text, flags=re.M)})
        else:
            cells.append({"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": [], "source": text})
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
        cell["source"] = cell["source"].splitlines(keepends=True)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made = {"cells": cells, "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(made, indent=1) + "\n"


if __name__ == "__main__":
    path = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent / "examples/plot_tile.py")
    path.with_suffix(".ipynb").write_text(notebook(path.read_text()))
