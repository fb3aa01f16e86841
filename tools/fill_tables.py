#!/usr/bin/env python3
"""Writes measured tables into documentation, so that nobody copies numbers by hand.

    tools/fill_tables.py RESULTS.json PAGE.md

RESULTS.json is the output of terrace_tin_bench or terrace_paper. In the page, the text between the lines

    <!-- table T1 -->
    <!-- end -->

becomes the table of that id, and the text between `<!-- context -->` and `<!-- end -->` the machine, its load at the start of the run, and
the compiler. Tables that are not in the file do not change. An id of the file without a place in the page is an error.
"""
import json
import pathlib
import re
import sys

BLOCK = re.compile(r"^<!-- (table (?P<id>[\w-]+)|context) -->\n.*?^<!-- end -->\n", re.MULTILINE | re.DOTALL)


def context_line(context):
    return (f"{context['cpu']}, {context['cores']} cores, load {context['load']}; {context['compiler']}, "
            f"`{context['flags']}`; commit {context['commit']}, {context['date'][:10]}.\n")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    results = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    page = pathlib.Path(sys.argv[2])
    tables = {table["id"]: table["markdown"] for table in results["tables"]}
    placed = set()

    def fill(block):
        opening = block[0].splitlines()[0]
        name = block["id"]
        if name is None:
            return f"{opening}\n\n{context_line(results['context'])}\n<!-- end -->\n"
        if name not in tables:
            return block[0]
        placed.add(name)
        return f"{opening}\n\n{tables[name]}\n<!-- end -->\n"

    page.write_text(BLOCK.sub(fill, page.read_text(encoding="utf-8")), encoding="utf-8")
    if missing := sorted(set(tables) - placed):
        sys.exit(f"{page}: no place for the tables {', '.join(missing)}")


if __name__ == "__main__":
    main()
