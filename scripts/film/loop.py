# SPDX-License-Identifier: Apache-2.0
"""A run's film as a small picture that moves, for a page: four times as fast, its main panes.

python -m scripts.film.loop out/demo docs/pictures/demo.webp
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
from PIL import Image

from scripts.console import ended
from scripts.film.encode import SIZE
from scripts.film.panes import Box, Layout
from sim.view import draw
from slam.errors import LogFormatError
from slam.files import replacing

WIDTH, HEIGHT = 900, 462
SPEED, PICTURE_MS = 4.0, 125
QUALITY = 60  # of WebP
_FILM = Layout.of(SIZE, camera=True)
assert _FILM.camera is not None
_ERRORS = Box(_FILM.chart.x, _FILM.chart.y, _FILM.chart.width, 94)  # the chart's upper part
# A box of the film, and where it goes: x and y px of its corner, and its width.
_PARTS = (
    (_FILM.camera, (540, 0, 360)),
    (_FILM.scan, (540, 228, 360)),
    (Box(16, 8, 744, 28), (8, 4, 520)),  # the title
    (_FILM.map, (0, 30, 532)),
    (_ERRORS, (0, 304, 532)),
    (Box(972, 8, 294, 28), (0, 402, 294)),  # whose colour is whose
    (Box(54, 372, 402, 20), (8, 434, 402)),  # what the beams hit
)


def pictures(film: Path) -> Iterator[Image.Image]:
    """Those of the page; raises ``LogFormatError`` for what is no film of that size."""
    reel = cv2.VideoCapture(str(film))
    size = round(reel.get(cv2.CAP_PROP_FRAME_WIDTH)), round(reel.get(cv2.CAP_PROP_FRAME_HEIGHT))
    if size != SIZE:
        raise LogFormatError(film, f"a film must have {SIZE} px, this has {size}")
    every, k = round(reel.get(cv2.CAP_PROP_FPS) * SPEED * PICTURE_MS / 1e3), 0
    while reel.grab():
        k += 1
        if k % every == 0:
            whole = Image.fromarray(cv2.cvtColor(reel.retrieve()[1], cv2.COLOR_BGR2RGB))
            page = Image.new("RGB", (WIDTH, HEIGHT), draw.PAPER)
            for box, (x, y, width) in _PARTS:
                part = whole.crop((box.x, box.y, box.x + box.width, box.y + box.height))
                size = width, round(box.height * width / box.width)
                page.paste(part.resize(size, Image.Resampling.LANCZOS), (x, y))
            yield page


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="a folder with film.mp4, of a room, in 3D too")
    parser.add_argument("out", type=Path, help="a file .webp")
    wanted = parser.parse_args(arguments)
    film = wanted.run / "film.mp4"
    if not (each := list(pictures(film))):
        raise LogFormatError(film, f"a film must last {PICTURE_MS / 1e3 * SPEED:g} s or more")
    with replacing(wanted.out) as temporary:
        each[0].save(temporary, "WEBP", save_all=True, append_images=each[1:], duration=PICTURE_MS,
                     loop=0, quality=QUALITY)  # fmt: skip
    print(f"{wanted.out}: {len(each)} pictures, {wanted.out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    sys.exit(main())
