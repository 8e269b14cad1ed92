# SPDX-License-Identifier: Apache-2.0
"""What mkdocs calls while it builds the site (``hooks`` in mkdocs.yml).

The pages in docs/ are read in the repository, too. So some things are written as they must be
there, and are changed here for the site alone.
"""

import posixpath
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.structure.files import File

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
REPLAYS = ROOT / "out" / "replays"
OUTSIDE = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
RESULTS = "results.md"  # the page of the folder docs/results
CODE = ("contributing.md", "layout.md", "dependencies.md", RESULTS)
OF_CODE, OF_JOBS = 0.2, 2.0  # weights of pages in a search; set by hand
INSTEAD = {"README.md": "index.md", "docs/results": RESULTS, **OUTSIDE}  # which page shows what
_LINK = re.compile(r"(?<=\]\()([^)\s#]+)")
_CLIP = re.compile(r'<a href="([^"]+\.mp4)"><img alt="([^"]*)" src="([^"]+)" ?/?></a>')
_CODE = re.compile(r"<code.*?</code>", re.DOTALL)
_OPTION = re.compile(r"(?<![\w-])--[a-z][\w-]*")
_VIDEO = (  # a click or Enter plays it; until then nothing covers the picture but a sign (site.css)
    r'<span class="clip"><video muted loop playsinline preload="none" tabindex="0" '
    r'onclick="this.controls=true;this.play();this.onclick=null" '
    r'onkeydown="if(event.key===\'Enter\'&amp;&amp;this.onclick)this.onclick()" '
    r'poster="\3" aria-label="\2"><source src="\1" type="video/mp4"></video></span>'
)


def on_files(files: "Files", *, config: "MkDocsConfig") -> "Files":
    """Add the pages that lie outside docs/, and one that lists the results files."""
    for name, page in OUTSIDE.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text.replace("](docs/", "](")))
    files.append(File.generated(config, RESULTS, content=_results()))
    return files


def _results() -> str:
    names = sorted(path.name for path in (ROOT / "docs" / "results").glob("*.*"))
    rows = "".join(f"- [{name}](results/{name})\n" for name in names)
    return f"# Measured results\n\nThe files that the pages quote.\n\n{rows}"


def on_page_markdown(markdown: str, *, page: "Page", config: "MkDocsConfig", files: "Files") -> str:
    """Links to files at the root, and to the folder of results, lead to their pages. Who searches
    finds the user's pages first, and no changelog."""
    del config, files
    name, folder = page.file.src_uri, posixpath.dirname(page.file.src_uri)
    boost = OF_CODE if folder == "api" or name in CODE else OF_JOBS if folder == "jobs" else 1.0
    page.meta["search"] = {"boost": boost, "exclude": name == OUTSIDE["CHANGELOG.md"]}

    def at_root(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join("docs", folder, link[1]))
        if target not in INSTEAD or page.file.src_uri in OUTSIDE.values():  # those are done
            return link[1]
        return posixpath.relpath(INSTEAD[target], folder or ".")

    return _LINK.sub(at_root, markdown)


def on_page_content(html: str, *, page: "Page", config: "MkDocsConfig", files: "Files") -> str:
    """A picture that links to a clip becomes the clip, with the picture until it is played; where
    there is a page to turn of the same, a link to it follows. No line ends within ``--option``."""
    del config, files

    def turned(clip: re.Match[str]) -> str:
        name = f"{Path(clip[1]).stem}.html"
        if not (REPLAYS / name).exists():
            return clip.expand(_VIDEO)
        to = posixpath.relpath(f"replays/{name}", posixpath.dirname(page.url) or ".")
        return f'{clip.expand(_VIDEO)}<br><a href="{to}">Turn it, scrub it</a>'

    def whole(code: re.Match[str]) -> str:
        return _OPTION.sub(r'<span class="option">\g<0></span>', code[0])

    return _CLIP.sub(turned, _CODE.sub(whole, html))


def on_post_build(*, config: "MkDocsConfig") -> None:
    """Pages to turn, where ``scripts.site.replays`` has made them, go into the site."""
    if REPLAYS.is_dir():
        shutil.copytree(REPLAYS, Path(config.site_dir) / "replays", dirs_exist_ok=True)
