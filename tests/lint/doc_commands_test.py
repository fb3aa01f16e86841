#!/usr/bin/env python3
"""Runs the commands of the documentation.

    doc_commands_test.py TERRACE            run the blocks of all pages
    doc_commands_test.py TERRACE --list     list the blocks and whether they are run

A block is code (fenced or indented) that begins with a command. Each is run by bash in a folder with small sample data, and must
succeed; curl talks to a server of config/samples. A block that cannot be run here has a comment before it, with the
reason:  <!-- not run: needs the network -->   A page of which none can be run has <!-- no command of this page is run: benchmarks -->
"""
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = (r"terrace|curl|make|cmake|ctest|ninja|python3|gdal\w*|ogr\w*|projsync|apt-get|apt|docker|podman|redis-server|redis-cli|kubectl|git|npm|"
            r"node|nginx|systemctl|fallocate|(?:\.\./)?(?:build|tools|tests|packaging|examples|docker|\w+/build)/\S+")
COMMAND = re.compile(rf"(?:\$ )?(?:sudo |[A-Z_]+=\S+ )*(?:{PROGRAMS})(?=\s|$)")
FENCE = re.compile(r"^( *)```(\w*)[^\n]*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"(?<=\n\n)(?:(?: {4,})\S.*\n(?:\n(?= {4}))?)+")
MARK = re.compile(r"<!-- not run: ([^\n]+) -->\n+$")
PAGE_MARK = re.compile(r"^<!-- no command of this page is run: (.+) -->$", re.MULTILINE)
# What would change the machine or asks another host. Such a block is never run, so it needs a comment.
FORBIDDEN = re.compile(r"\b(?:apt|apt-get|sudo|systemctl|service|docker|podman|kubectl)\s|/etc/|/var/|/usr/|https://")
# In the scratch folder: a server is stopped as soon as it is ready.
PREAMBLE = """
set -eo pipefail
terrace() {
  if [[ $1 != serve ]]; then command terrace "$@"; return; fi
  rm -f served.txt; touch served.txt  # of the server before
  command terrace "$@" --listen 127.0.0.1:0 >> served.txt & local pid=$! code=0
  until grep -q http:// served.txt; do kill -0 $pid || { wait $pid; return; }; sleep 0.05; done
  kill -TERM $pid; wait $pid || code=$?
  return $code
}
python3() {
  if [[ $1$2 != -mhttp.server ]]; then command python3 "$@"; return; fi
  timeout 1 python3 -m http.server 0 "${@:3}" > /dev/null 2>&1 || [[ $? == 124 ]]
}
"""
EDIT = {"type": "FeatureCollection", "features": [{
    "type": "Feature", "properties": {"terrain": {"op": "flatten", "height": 400, "blend_m": 100}},
    "geometry": {"type": "Polygon", "coordinates": [[[-84.41, 36.44], [-84.40, 36.44], [-84.40, 36.445], [-84.41, 36.445], [-84.41, 36.44]]]}}]}


class Block:
    def __init__(self, page, text, start, code):
        self.page, self.code = page.relative_to(ROOT), code
        self.line = text.count("\n", 0, start) + 1
        mark = MARK.search(text[:start]) or PAGE_MARK.search(text)
        self.reason = mark and mark[1]

        self.script, self.output = self.divided()

    def divided(self):
        """The commands, and the output that the page shows: after a prompt, with their continuations, if there are prompts; else all lines."""
        lines = self.code.splitlines()
        if not any(line.startswith("$ ") for line in lines):
            return self.code, ""
        commands, output, goes_on = [], [], False
        for line in lines:
            if line.startswith("$ ") or goes_on:
                commands.append(line.removeprefix("$ "))
                goes_on = line.endswith("\\")
            else:
                output.append(line)
        return "\n".join(commands) + "\n", "\n".join(output)


def blocks_of(page):
    text = page.read_text()
    fences = list(FENCE.finditer(text))
    for match in fences:
        if match[2] in ("", "sh", "bash", "console"):
            yield Block(page, text, match.start(), re.sub(rf"^{match[1]}", "", match[3], flags=re.MULTILINE))
    for match in INDENTED.finditer(text):
        if not any(fence.start() < match.start() < fence.end() for fence in fences):
            lines = match[0].splitlines()
            indent = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
            yield Block(page, text, match.start(), "\n".join(line[indent:] for line in lines) + "\n")


def lasting(text):
    """Without what differs from run to run and between versions of libraries: places, dates, times, ids, versions, sums."""
    text = re.sub(r"^(Date|Server-Timing|ETag):.*", r"\1", text.replace("\r", ""), flags=re.MULTILINE)
    text = re.sub(r'"request_id":"[0-9a-f]+"', "request_id", text)
    return re.sub(r"\b[0-9a-f]{12}\b", "VERSION", text).replace("\n", "")  # replies do not end with a line break


def all_blocks():
    names = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    for name in names:
        for block in blocks_of(ROOT / name):
            first = next((line for line in block.code.splitlines() if line.strip() and not line.startswith("#")), "")
            if COMMAND.match(first):
                yield block


def make_samples(folder):
    """dem.tif and alps.tif: a corner of a sample; photo.tif and photo.png: its heights as grey; edits."""
    def run(*command):
        subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    run("gdal_translate", "-q", "-srcwin", 0, 0, 100, 100, ROOT / "config/samples/jacksboro.tif", folder / "dem.tif")
    run("gdal_translate", "-q", "-ot", "Byte", "-scale", "-b", 1, "-b", 1, "-b", 1, folder / "dem.tif", folder / "photo.tif")
    run("gdal_translate", "-q", "-of", "PNG", folder / "photo.tif", folder / "photo.png")
    (folder / "alps.tif").write_bytes((folder / "dem.tif").read_bytes())
    for name in ("runway.geojson", "roads.geojson"):
        (folder / name).write_text(json.dumps(EDIT))


class DocCommands(unittest.TestCase):
    def test_blocks_run_or_say_why_not(self):
        blocks = list(all_blocks())
        run = [block for block in blocks if not block.reason]
        self.assertGreater(len(run), 10)
        wrong = []
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch)
            make_samples(folder)
            programs = folder / "build/release/server/cli"
            programs.mkdir(parents=True)
            (programs / "terrace").symlink_to(TERRACE)
            for name in ("examples", "config", "docs"):
                (folder / name).symlink_to(ROOT / name)
            server = subprocess.Popen([TERRACE, "serve", "--config", str(ROOT / "config/samples/samples.json"), "--listen", "127.0.0.1:0"],
                                      stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            try:
                place = re.search(r"http://([^/\s]+)", server.stdout.readline())[1]
                environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}
                for block in run:
                    if FORBIDDEN.search(block.script):
                        wrong.append(f"{block.page}:{block.line}: would change the machine or ask another host: "
                                     f"put <!-- not run: REASON --> before it\n{block.script}")
                        continue
                    script = re.sub(r"(127\.0\.0\.1|localhost):8080", place, block.script)
                    script = re.sub(r"build/release/server/cli/terrace\b", "terrace", script)
                    done = subprocess.run(["timeout", "60", "bash", "-c", PREAMBLE + script], cwd=folder, env=environment, text=True,
                                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
                    # 141: `head` had enough.
                    if done.returncode not in (0, 141):
                        wrong.append(f"{block.page}:{block.line}: exit status {done.returncode}\n{block.script}{done.stdout[-600:]}")
                    elif block.output and lasting(done.stdout) != lasting(block.output):
                        wrong.append(f"{block.page}:{block.line}: the page shows\n{lasting(block.output)}\nbut the output is\n{lasting(done.stdout)}")
            finally:
                server.send_signal(signal.SIGTERM)
                server.communicate()
        self.assertEqual(wrong, [], "\n" + "\n".join(wrong))


if __name__ == "__main__":
    TERRACE = str(pathlib.Path(sys.argv.pop(1)).resolve())
    if "--list" in sys.argv:
        for block in all_blocks():
            print(f"{block.page}:{block.line}: {'not run: ' + block.reason if block.reason else 'run'}: {block.code.splitlines()[0][:100]}")
    else:
        unittest.main()
