"""Hooks of mkdocs. Pages link to files of the repository that the site does not contain; there they become plain text. Debian's
mkdocs 1.4 names its jQuery otherwise than its pages do, and lacks a script that marks tables for the CSS file: both are corrected."""
import pathlib
import posixpath
import re

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./|[a-z])[^)#:]*)(#[^)]*)?\)")


def on_page_markdown(markdown, page, config, files):
    folder = posixpath.dirname(page.file.src_path)
    pages = {file.src_path for file in files}

    def link(match):
        target = posixpath.normpath(posixpath.join(folder, match.group(2)))
        if target in pages:
            return match.group(0)
        if target + "/index.md" in pages or target.rstrip("/") == "decisions":
            return match.group(0).replace(match.group(2), match.group(2).rstrip("/") + "/index.md")
        return match.group(1)

    return LINK.sub(link, markdown)


SCRIPT = re.compile(r'\s*<script[^>]*src="([^":]*/)?js/([^"/]+)"[^>]*></script>')


def complete(html, config):
    present = {path.name for folder in config["theme"].dirs for path in pathlib.Path(folder).glob("js/*") if path.exists()}
    jquery = min((name for name in present if name.startswith("jquery")), default=None)

    def script(match):
        name = match.group(2)
        if name in present:
            return match.group(0)
        return match.group(0).replace(name, jquery) if jquery and name.startswith("jquery") else ""

    return SCRIPT.sub(script, html).replace("<table>", '<table class="docutils">')


def on_post_page(output, page, config):
    return complete(output, config)


def on_post_template(output_content, template_name, config):
    return complete(output_content, config) if template_name.endswith(".html") else output_content
