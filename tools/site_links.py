"""Hook of mkdocs: pages link to files of the repository that the site does not contain; there they become plain text."""
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
