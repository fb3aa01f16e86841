#!/usr/bin/env python3
"""Checks the links of every Markdown file: relative ones lead to a file, `#parts` to a heading. Builds the site where mkdocs is installed."""
import html
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")


def pages():
    names = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    return [ROOT / name for name in names if (ROOT / name).is_file()]


def without_code(text):
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(page):
    """As GitHub makes them: lower case, without punctuation, blanks become hyphens, repetitions are numbered."""
    text = page.read_text()
    found, counts = set(re.findall(r'<a id="([^"]+)">', text)), {}
    for heading in re.findall(r"^#{1,6} +(.+?) *$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", heading.lower().replace("`", "")).replace(" ", "-")
        count = counts[name] = counts.get(name, -1) + 1
        found.add(name if count == 0 else f"{name}-{count}")
    return found


def broken_in_site(folder):
    """References of the site's pages, scripts and CSS files included, that lead to no file or no element of it."""
    texts = {page: page.read_text() for page in folder.rglob("*.html") if page.name != "404.html"}
    names = {page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in texts.items()}
    broken = []
    for page, text in texts.items():
        for target in re.findall(r'<(?:a|link|script|img)\b[^>]*?\b(?:href|src)="([^"]+)"', text):
            if re.match(r"[a-z]+:|//", target):
                continue
            path, _, part = urllib.parse.unquote(html.unescape(target)).partition("#")
            file = (page.parent / path.partition("?")[0]).resolve() if path else page
            file = file / "index.html" if file.is_dir() else file
            if not file.is_file() or (part and file.suffix == ".html" and part not in names[file]):
                broken.append(f"{page.relative_to(folder)}: {target}")
    return broken


class Links(unittest.TestCase):
    def test_each_leads_somewhere(self):
        broken, total = [], 0
        for page in pages():
            for target in LINK.findall(without_code(page.read_text())):
                if re.match(r"[a-z]+:", target):
                    continue
                total += 1
                path, _, part = target.partition("#")
                file = (page.parent / path).resolve() if path else page
                if not file.exists():
                    broken.append(f"{page.relative_to(ROOT)}: {target}: no such file")
                elif part and file.suffix == ".md" and part not in anchors(file):
                    broken.append(f"{page.relative_to(ROOT)}: {target}: no such heading")
        self.assertGreater(total, 100)
        self.assertEqual(broken, [])

    def test_the_menu_of_the_site_has_each_page(self):
        menu = (ROOT / "mkdocs.yml").read_text()
        missing = [page.name for folder in (ROOT / "docs", ROOT / "docs/formats") for page in folder.glob("*.md")
                   if f": {page.relative_to(ROOT / 'docs')}\n" not in menu]
        self.assertEqual(missing, [])

    @unittest.skipUnless(shutil.which("mkdocs"), "mkdocs is not installed")
    def test_the_site_builds_without_a_warning(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(["mkdocs", "build", "--strict", "-d", folder], cwd=ROOT, text=True, capture_output=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((pathlib.Path(folder) / "http-api.html").is_file())
            other_hosts = re.findall(r"(?:src|href)=\"(?:https?:)?//[^\"]+\.(?:js|css|woff2?)\"", (pathlib.Path(folder) / "index.html").read_text())
            self.assertEqual(other_hosts, [])
            self.assertEqual(broken_in_site(pathlib.Path(folder)), [])


if __name__ == "__main__":
    unittest.main()
