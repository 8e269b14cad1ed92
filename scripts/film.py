# SPDX-License-Identifier: Apache-2.0
"""H.264 films without a window: frames are composed as arrays and piped to ffmpeg."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import imageio_ffmpeg
import numpy as np

from scripts import draw
from scripts.draw import Picture
from slam.errors import MissingDependencyError, OutputError
from slam.files import replacing

WIDTH, HEIGHT = 1280, 720


def require_ffmpeg() -> None:
    """Raise ``MissingDependencyError`` with a remedy when no ffmpeg can be found."""
    try:
        imageio_ffmpeg.get_ffmpeg_version()  # runs it
    except (RuntimeError, OSError, subprocess.SubprocessError, IndexError) as error:
        raise MissingDependencyError(
            "no ffmpeg was found to write the film: install one (pip install imageio-ffmpeg brings "
            "its own) or set IMAGEIO_FFMPEG_EXE, or pass --no-film"
        ) from error


@contextmanager
def film(path: Path, fps: float) -> Iterator[Film]:
    """A film that appears under ``path`` when the block ends well, and not at all otherwise."""
    require_ffmpeg()
    with replacing(path) as temporary:
        writer = imageio.get_writer(
            temporary, fps=fps, codec="libx264", pixelformat="yuv420p", macro_block_size=16,
            ffmpeg_params=["-preset", "veryfast", "-crf", "21"], ffmpeg_log_level="error",
        )  # fmt: skip
        try:
            yield Film(writer, path)
        finally:
            writer.close()


@dataclass(eq=False)
class Film:
    """Takes (height, width, 3) uint8 pictures one at a time."""

    writer: Any
    path: Path
    frames: int = 0
    last: Picture | None = None

    def add(self, picture: Picture) -> None:
        """Append one picture; raises ``OutputError`` when ffmpeg stops (disk full, say)."""
        try:
            self.writer.append_data(picture)
        except OSError as error:
            why = str(error).strip().partition("\n")[0]
            raise OutputError(f"cannot write {self.path}: ffmpeg stopped ({why})") from error
        self.frames += 1
        self.last = picture


@dataclass(frozen=True)
class Pane:
    """One part of a film frame: its title and its box (x, y, width, height) in pixels."""

    title: str
    x: int
    y: int
    width: int
    height: int


def compose(headline: str, parts: Sequence[tuple[Pane, Picture]]) -> Picture:
    """A 1280 x 720 frame: a headline, and each picture in its pane under its title."""
    canvas: Picture = np.full((HEIGHT, WIDTH, 3), draw.PAPER, np.uint8)
    draw.text(canvas, headline, (16, 10), 17, draw.INK, bold=True)
    for pane, picture in parts:
        draw.paste(canvas, picture, (pane.x, pane.y), (pane.width, pane.height))
        if pane.title:
            draw.text(canvas, pane.title, (pane.x, pane.y - 20), 13, draw.MUTED)
    return canvas
