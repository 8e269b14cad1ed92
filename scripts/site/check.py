# SPDX-License-Identifier: Apache-2.0
"""Check a built site: ``python -m scripts.site.check out/site``.

No page may load anything from elsewhere. Broken links mkdocs finds itself (``validation``).
"""

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

_LOADS = {  # attributes of a tag whose address is fetched without a click
    "audio": ("src",), "embed": ("src",), "iframe": ("src",), "image": ("href", "xlink:href"),
    "img": ("src", "srcset"), "input": ("src",), "link": ("href",), "object": ("data",),
    "script": ("src",), "source": ("src", "srcset"), "track": ("src",), "use": ("href",),
    "video": ("src", "poster"), "body": ("background",),
}  # fmt: skip
_NO_FETCH = {"canonical", "alternate", "next", "prev", "author", "license"}  # rel of <link>
_CSS = re.compile(r"url\(\s*['\"]?([^'\")]+)|@import\s+['\"]([^'\"]+)")
_ELSEWHERE = re.compile(r"(?:[a-z][a-z0-9+.-]*:)?//", re.IGNORECASE)


@dataclass
class Page(HTMLParser):
    """What one page loads."""

    path: Path
    loads: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._in_style = False
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Called for each tag."""
        given = {name: value or "" for name, value in attrs}
        self._in_style = tag == "style"
        self.loads += _CSS_of(given.get("style", ""))
        if tag == "link" and _NO_FETCH & set(given.get("rel", "").split()):
            return
        for name in _LOADS.get(tag, ()):
            if name == "srcset":
                self.loads += [
                    one.split()[0] for one in given.get(name, "").split(",") if one.strip()
                ]
            elif name in given:
                self.loads.append(given[name])

    def handle_data(self, data: str) -> None:
        """Called for each text; that of <style> is CSS."""
        if self._in_style:
            self.loads += _CSS_of(data)

    def handle_endtag(self, tag: str) -> None:
        """Called for each end of a tag."""
        self._in_style = False


def _CSS_of(text: str) -> list[str]:
    return [a or b for a, b in _CSS.findall(text)]


def faults(site: Path) -> Iterator[str]:
    """What is wrong in the site, in words, one file after the other."""
    for path in sorted([*site.rglob("*.html"), *site.rglob("*.css")]):
        loads = Page(path).loads if path.suffix == ".html" else _CSS_of(path.read_text("utf-8"))
        name = path.relative_to(site).as_posix()
        yield from (f"{name} loads {load}" for load in loads if _ELSEWHERE.match(load))


def main(arguments: list[str]) -> int:
    """0 when nothing is wrong, 1 with a line for each fault, 2 where there is no site."""
    (folder,) = arguments or ["out/site"]
    site = Path(folder)
    if not (site / "index.html").exists():
        print(f"There is no site in '{site}': make docs", file=sys.stderr)
        return 2
    found = list(faults(site))
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    if not found:
        count = sum(1 for _ in site.rglob("*.html"))
        print(f"{site}: {count} pages; nothing is loaded from elsewhere")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
