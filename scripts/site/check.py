# SPDX-License-Identifier: Apache-2.0
"""Check a built site: ``python -m scripts.site.check out/site``.

No page may load anything from elsewhere, and every link to a page, a picture or a heading of the
site must lead there. Links that a reader may follow to other sites are left alone.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

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
    """What one page loads, where its links lead, and its places that links can lead to."""

    path: Path
    loads: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    places: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__init__()
        self._in_style = False
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Called for each tag."""
        given = {name: value or "" for name, value in attrs}
        self._in_style = tag == "style"
        self.places.update(given[name] for name in ("id", "name") if name in given)
        self.loads += _CSS_of(given.get("style", ""))
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
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
    pages = {path.resolve(): Page(path) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        name = path.relative_to(site.resolve()).as_posix()
        yield from (f"{name} loads {load}" for load in page.loads if _ELSEWHERE.match(load))
        if name == "404.html":
            continue  # its links begin at the root of the server
        here = [load for load in page.loads if not _ELSEWHERE.match(load)]
        for target in (*here, *page.links):
            if not leads_somewhere(target, path, pages):
                yield f"{name} links to {target}, which is not there"
    for path in sorted(site.rglob("*.css")):
        text = path.read_text(encoding="utf-8")
        for load in _CSS_of(text):
            if _ELSEWHERE.match(load):
                yield f"{path.relative_to(site).as_posix()} loads {load}"


def leads_somewhere(target: str, path: Path, pages: dict[Path, Page]) -> bool:
    """Whether a link on the page at ``path`` leads to a file, and to a place on its page."""
    parts = urlsplit(target)
    if parts.scheme or parts.netloc:
        return True
    there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if there.is_dir():
        there /= "index.html"
    if not there.exists():
        return False
    place = unquote(parts.fragment)
    return not place or there not in pages or place in pages[there].places | {"__comments"}


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
        print(
            f"{site}: {count} pages; every link leads somewhere, nothing is loaded from elsewhere"
        )
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
