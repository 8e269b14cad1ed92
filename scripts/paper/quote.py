# SPDX-License-Identifier: Apache-2.0
"""Results into a page: ``python -m scripts.paper.quote out/reproduce docs/paper.md``.

Between ``<!-- landmarks -->`` and ``<!-- /landmarks -->`` (and so on) the page gets what the
experiment's ``summary.md`` says, and its figures as small PNGs in ``pictures/paper`` beside the
page; between the marks of ``all`` what all took together. Experiments that were not run keep what
is there.
"""

from __future__ import annotations

import argparse
import io
import re
import sys
from pathlib import Path

from PIL import Image

from scripts.marks import filled
from scripts.paper import EXPERIMENTS
from slam.files import write_bytes, write_text

PICTURES = "pictures/paper"
MOST_BYTES = 150_000
_PICTURE = re.compile(r"\]\(([\w-]+\.png)\)")


def quote(results: Path, page: Path) -> list[str]:
    """Fill in the page; which experiments it now quotes anew."""
    text, found = page.read_text(), {}
    for name in ("all", *EXPERIMENTS):
        summary = results / ("" if name == "all" else name) / "summary.md"
        if not summary.exists():
            continue
        told = summary.read_text().strip()
        found[name] = _PICTURE.findall(told)
        told = _PICTURE.sub(rf"]({PICTURES}/{name}-\1)", told)
        text = filled(text, name, told, page)
    for name, files in found.items():
        _take_pictures(results / name, files, page.parent / PICTURES, name)
    write_text(page, text)
    return list(found)


def _take_pictures(source: Path, files: list[str], folder: Path, name: str) -> None:
    """Copies of these, and none that an earlier call left."""
    for file in files:
        write_bytes(folder / f"{name}-{file}", compact(source / file))
    for old in folder.glob(f"{name}-*.png"):
        if old.name.removeprefix(f"{name}-") not in files:
            old.unlink()


def compact(picture: Path, most: int = MOST_BYTES) -> bytes:
    """The picture as a PNG of few colours, smaller if need be: ``most`` bytes."""
    with Image.open(picture) as opened:
        image = opened.convert("RGB")
    while True:
        # not the median cut: it drops colours of few pixels, and thin lines are few pixels
        few = image.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        few.save(file := io.BytesIO(), "PNG", optimize=True)
        if file.tell() <= most:
            return file.getvalue()
        size = (max(1, image.width * 4 // 5), max(1, image.height * 4 // 5))
        image = image.resize(size, Image.Resampling.LANCZOS)


def main(arguments: list[str] | None = None) -> int:
    """Say what was quoted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="folder that reproduce wrote")
    parser.add_argument("page", type=Path, help="Markdown page with the marks")
    wanted = parser.parse_args(arguments)
    print("quoted:", ", ".join(quote(wanted.results, wanted.page)) or "nothing")
    return 0


if __name__ == "__main__":
    sys.exit(main())
