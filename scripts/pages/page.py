# SPDX-License-Identifier: Apache-2.0
"""``index.html`` of every folder: what came out, the film or picture, the files, what to do next.

A page opens from disk and asks for nothing elsewhere. ``base.html`` is every page's head, style
and macros; the report of a comparison is another page of it.
"""

import base64
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table as Printed

from scripts.console import fact, say
from scripts.pages.table import of_printed
from sim.recording.sums import SUMS, add_to_sums
from slam.files import write_text

INDEX, INLINE = "index.html", "data:image/png;base64,"
HERE = Path(__file__).parent
ABOUT: dict[str, str] = tomllib.loads((HERE / "files.toml").read_text(encoding="utf-8"))
LISTED = 24  # files of a kind beyond these are counted


@dataclass(frozen=True, kw_only=True)
class Part:
    """A section: a picture, words, a table as it was printed, what a colour means."""

    title: str
    picture: str = ""  # name of a file there, or what ``inline`` gives
    note: str = ""
    table: Printed | None = None
    legend: Mapping[str, str] = field(default_factory=dict)  # words by colour


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page of a folder; ``said`` in backticks is a name, ``next`` has commands by their purpose
    (``scripts.spec.command_line``).

    settings  how it was made, at the end of the page
    """

    title: str
    said: Sequence[str]
    parts: Sequence[Part] = ()
    next: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


def write(folder: Path, page: Page) -> Path:
    """``index.html`` among the files of ``folder``, which are listed; its path."""
    path = folder / INDEX
    parts = [
        one
        for one in page.parts
        if one.picture.startswith(INLINE) or (folder / one.picture).exists()  # "": the folder
    ]
    text = template("folder.html").render(
        page=page, marks={}, files=_files(folder),
        parts=[(one, None if one.table is None else of_printed(one.table)) for one in parts],
        film=(folder / "film.mp4").exists(), replay=(folder / "replay.html").exists(),
    )  # fmt: skip
    write_text(path, text.encode("utf-8", "backslashreplace").decode())  # names are any bytes
    return path


def publish(folder: Path, page: Page) -> None:
    """Write the page of a folder that is there already, and say what it says."""
    add_to_sums(write(folder, page))
    tell(folder, page)


def tell(folder: Path, page: Page) -> None:
    """What came out, and where the page is."""
    for line in page.said:
        fact(line)
    say(f"Open [bold]{escape(str(folder / INDEX))}[/bold] first.", highlight=False)


@cache
def template(name: str, folder: Path = HERE) -> jinja2.Template:
    """A template of ``folder``, which may extend or import those here."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, HERE]), autoescape=jinja2.select_autoescape(),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["parts"] = lambda name: re.findall(r"[^:/_.]*[:/_.]?", name)[:-1]
    return environment.get_template(name)


def inline(picture: NDArray[np.uint8]) -> str:
    """An RGB picture (height, width, 3) that lies in the page itself, as PNG."""
    _, png = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    return INLINE + base64.b64encode(png.tobytes()).decode()


def _names(folder: Path, pattern: str = "*") -> list[str]:
    return [p.relative_to(folder).as_posix() for p in folder.glob(pattern) if p.is_file()]


def _files(folder: Path) -> list[tuple[str, str]]:
    """Names that are there, and what each is."""
    last = {SUMS} if (folder / "dataset.json").exists() else {SUMS, "recipe.json"}  # written later
    there = sorted({*_names(folder), *_names(folder, "replays/*.html"), *last})
    found: dict[str, str] = {}
    for pattern, about in ABOUT.items():
        own = [name for name in there if fnmatch(name, pattern) and name not in found]
        found |= dict.fromkeys(own[:LISTED], about)
    return list(found.items())
