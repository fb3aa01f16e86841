#!/usr/bin/env python3
"""Checks the commands and URLs of the documentation against the program.

    commands_test.py TERRACE

Every `terrace COMMAND --flag` of a page is a flag that `terrace COMMAND --help` lists. Every URL of a sample dataset at
http://127.0.0.1:8080 is requested from a server of the samples, and must be answered by 200. EXPECTED lists URLs that
show an error on purpose, and arguments of scripts that are no URLs of the server.
"""
import pathlib
import re
import signal
import subprocess
import sys
import unittest
import urllib.error
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMAND = re.compile(r"(?<![\w-])terrace (serve|mesh|info|bake status|bake|fly)\b([^\n`#]*)")
URL = re.compile(r"https?://(?:127\.0\.0\.1|localhost):8080(/[^\s`'\"{}<>)]*)")
EXPECTED = {"/earth": 404, "/jacksboro": 404, "/jacksboro/heights": 400, "/nope/layer.json": 404, "/jacksboro/9/272/359.terrain?error=0": 400}
OTHER_DATA = re.compile(r"^/(andes|alps|maui|dem|NAME|DATASET)\b")


def pages():
    names = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    return [ROOT / name for name in names if (ROOT / name).is_file()]


class Commands(unittest.TestCase):
    def test_every_flag_exists(self):
        known, wrong, total = {}, [], 0
        for page in pages():
            text = page.read_text().replace("\\\n", " ").replace("\\|", "|")
            for command, rest in COMMAND.findall(text):
                if command not in known:
                    help_text = subprocess.run([TERRACE, *command.split(), "--help"], text=True, capture_output=True).stdout
                    known[command] = set(re.findall(r"^ +(?:-\w,)?(--[a-z][a-z-]+)", help_text, re.MULTILINE)) | {"--help"}
                for flag in re.findall(r"(?<![\w-])--[a-z][a-z-]*", re.split(r"[;&]| \| ", rest)[0]):
                    total += 1
                    if flag not in known[command]:
                        wrong.append(f"{page.relative_to(ROOT)}: terrace {command} {flag}")
        self.assertGreater(total, 40)
        self.assertEqual(wrong, [])

    def test_every_url_of_the_samples_is_answered(self):
        server = subprocess.Popen([TERRACE, "serve", "--config", str(ROOT / "config/samples/samples.json"), "--listen", "127.0.0.1:0"],
                                  stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            root = re.search(r"http://\S+?(?=/?\s*$)", server.stdout.readline()).group(0)
            urls = {(match.group(1).rstrip(".,;"), page.relative_to(ROOT)) for page in pages() for match in URL.finditer(page.read_text())}
            wrong, total = [], 0
            for url, page in sorted(urls):
                if OTHER_DATA.match(url) or "[" in url or "$" in url:
                    continue
                total += 1
                try:
                    with urllib.request.urlopen(root + url) as reply:
                        status = reply.status
                except urllib.error.HTTPError as error:
                    status = error.code
                if status != EXPECTED.get(url, 200):
                    wrong.append(f"{page}: {url}: {status}")
            self.assertGreater(total, 10)
            self.assertEqual(wrong, [])
        finally:
            server.send_signal(signal.SIGTERM)
            server.communicate()


if __name__ == "__main__":
    TERRACE = sys.argv.pop(1)
    unittest.main()
