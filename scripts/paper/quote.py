# SPDX-License-Identifier: Apache-2.0
"""Results into the pages: ``python -m scripts.paper.quote out/reproduce docs/paper``.

Between ``<!-- landmarks -->`` and ``<!-- /landmarks -->`` (and so on) the page of the folder that
has these marks gets what the experiment's ``summary.md`` says. The figures become small PNGs in
``../pictures/paper``, long tables become CSV files in ``../results``. The text of an experiment
that was not run stays.
"""

import argparse
import io
import re
import sys
from pathlib import Path

from PIL import Image

from scripts.marks import filled, with_tables_apart
from scripts.paper import EXPERIMENTS
from slam.errors import InvalidValueError
from slam.files import write_bytes, write_text

PICTURES, RESULTS = "../pictures/paper", "../results"
MOST_BYTES = 150_000
_PICTURE = re.compile(r"\]\(([\w-]+\.png)\)")


def quote(results: Path, folder: Path) -> list[str]:
    """Fill in the pages of the folder; return the names of the experiments that were filled in.

    Raises ``InvalidValueError`` where an experiment's marks do not stand once on just one page.
    """
    texts = {page: page.read_text() for page in sorted(folder.glob("*.md"))}
    found = {}
    for name in EXPERIMENTS:
        summary = results / name / "summary.md"
        if not summary.exists():
            continue
        told = summary.read_text().strip()
        found[name] = _PICTURE.findall(told)
        told = _PICTURE.sub(rf"]({PICTURES}/{name}-\1)", told)
        # the one page that has the mark
        pages = [page for page, text in texts.items() if f"<!-- {name} -->" in text]
        if len(pages) != 1:
            have = ", ".join(page.name for page in pages) or "no page"
            raise InvalidValueError(f"{folder}: {have} has <!-- {name} -->, must be one page")
        page = pages[0]
        told = with_tables_apart(told, f"paper_{name}", folder / RESULTS, folder)
        texts[page] = filled(texts[page], name, told, page)
    for name, files in found.items():
        _take_pictures(results / name, files, folder / PICTURES, name)
    for page, text in texts.items():
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
    """Print what was quoted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="folder that reproduce wrote")
    parser.add_argument("folder", type=Path, help="folder of the Markdown pages with the marks")
    wanted = parser.parse_args(arguments)
    print("quoted:", ", ".join(quote(wanted.results, wanted.folder)) or "nothing")
    return 0


if __name__ == "__main__":
    sys.exit(main())
