# SPDX-License-Identifier: Apache-2.0
"""Filming: every frame through every SLAM, pictures when they are due, strips of some."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from rich.markup import escape

from scripts import interrupt
from scripts.console import progress
from scripts.film.encode import Film
from scripts.film.show import Show
from sim.view import draw
from sim.view.draw import Picture
from slam.errors import InvalidValueError
from slam.files import replacing
from slam.frames import BeamClass, Frame, Stream

CELL_WIDTH = 400  # px
TOP, GAP, MARGIN = 6, 10, 14
LABEL = 22  # px above a picture for its time
KEY_PX, SWATCH = 13, 20  # px, of the words and of the colours of a legend
Legend = Sequence[tuple[str, draw.Color]]


def shoot(stream: Stream, show: Show, reel: Film | None) -> Iterator[Frame]:
    """Replay ``stream`` until the film ends, yield each frame once it is noted and filmed."""
    taken = 0
    for frame in show.replay.run(stream):
        seconds = show.note(frame).seconds
        due = show.pace.due(seconds) - taken if reel is not None else 0
        over = seconds > show.pace.to_s
        if reel is not None and due > 0:
            before = reel.last if reel.last is not None else show.paint(frame)
            for _ in range(due if over else due - 1):  # until now the world looked as before
                reel.add(before)
            if not over:
                reel.add(show.paint(frame))
            taken += due
        if over:
            return
        yield frame


def watched(frames: Iterator[Frame], stream: Stream, title: str) -> Iterator[Frame]:
    """``frames`` behind a progress bar."""
    with progress() as bar:
        warming = "compiling inner loops (the first run only, about half a minute)"
        task = bar.add_task(warming, total=stream.length, unit="")
        for count, frame in enumerate(frames, 1):
            interrupt.check()
            if count == 1:  # what compiling took says nothing of the pace
                bar.reset(task, total=stream.length, description=escape(title))
            if count % 25 == 0 or count == stream.length:
                bar.update(task, completed=count, unit=f"{count}/{stream.length} scans")
            yield frame


class Liveliest:
    """The picture of a film at the end of the second in which most beams met what moves.

    The first third does not count: its map is young. Without labels it is the last one.
    """

    def __init__(self, least_s: float) -> None:
        self.picture: Picture | None = None
        self._least_s, self._most = least_s, -1
        self._second: deque[tuple[float, int]] = deque()

    def note(self, frame: Frame, seconds: float, picture: Picture | None) -> None:
        """Call after each frame, with the newest picture."""
        moving = 0
        if frame.labels is not None:
            moving = int((frame.labels.kind == BeamClass.MOVING).sum())
        self._second.append((seconds, moving))
        while self._second[0][0] <= seconds - 1.0:
            self._second.popleft()
        beams = sum(count for _, count in self._second)
        if seconds >= self._least_s and (beams > self._most or frame.labels is None):
            self.picture, self._most = picture, beams


class Snapshots:
    """Keeps the pictures of a few moments while a run goes by.

    seconds  since the first frame, in rising order; a picture is of the first frame then or later
    paint    which picture: ``show.vignette`` (for strips) or ``show.paint`` (the whole frame)
    """

    def __init__(
        self, show: Show, seconds: Sequence[float], paint: Callable[[Frame], Picture]
    ) -> None:
        self._show, self._seconds, self._paint = show, tuple(seconds), paint
        self.pictures: list[Picture] = []

    def note(self, frame: Frame) -> None:
        """Take the pictures that are due."""
        now = self._show.moments.seconds
        while not self.done() and now >= self._seconds[len(self.pictures)] - 1e-6:
            self.pictures.append(self._paint(frame))
        self._last = frame

    def done(self) -> bool:
        """Whether all are taken."""
        return len(self.pictures) == len(self._seconds)

    def finish(self) -> list[Picture]:
        """All of them; moments after the end of the run show its end."""
        while not self.done():
            self.pictures.append(self._paint(self._last))
        return self.pictures


def evenly(n: int, start_s: float, end_s: float) -> list[float]:
    """``n`` moments from ``start_s`` to ``end_s``, ends included; one alone is the end."""
    if n < 1:
        raise InvalidValueError(f"a strip needs at least 1 moment, got {n}")
    return [end_s] if n == 1 else np.linspace(start_s, end_s, n).tolist()


def strip(
    pictures: Sequence[Picture],
    seconds: Sequence[float],
    path: Path,
    *,
    columns: int,
    cell_width: int = CELL_WIDTH,
    legend: Legend = (),
) -> Picture:
    """Pictures of moments, ``columns`` a line, with their times; written to ``path``.

    pictures  (height, width, 3) uint8 RGB, all of one size
    seconds   of each, written above it
    legend    what colours stand for, written below all of them
    """
    columns, lines = min(columns, len(seconds)), -(-len(pictures) // columns)
    width = cell_width
    height = max(1, round(pictures[0].shape[0] * width / pictures[0].shape[1]))
    wide, high = columns * (width + GAP) - GAP, TOP + lines * (LABEL + height + GAP) - GAP
    inner: Picture = np.full((high, wide, 3), draw.PAPER, np.uint8)
    for k, (part, at_s) in enumerate(zip(pictures, seconds, strict=True)):
        line, column = divmod(k, columns)
        x, y = column * (width + GAP), TOP + line * (LABEL + height + GAP)
        draw.text(inner, f"{at_s:.1f} s", (x, y + 3), 13, draw.MUTED, bold=True)
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
        inner[y + LABEL : y + LABEL + height, x : x + width] = small
    if legend:
        inner = np.vstack([inner, _key(legend, wide)])
    edges = (0, MARGIN, MARGIN, MARGIN)
    padded = cv2.copyMakeBorder(inner, *edges, cv2.BORDER_CONSTANT, value=draw.PAPER)
    whole: Picture = np.asarray(padded, np.uint8)
    with replacing(path) as temporary:
        Image.fromarray(whole).save(temporary, format="PNG", optimize=True)
    return whole


def _key(legend: Legend, width: int) -> Picture:
    """Colours and words, in as many lines as they take."""
    places, x, line = [], 0, 0
    for word, color in legend:
        wide = SWATCH + draw.text_width(word, KEY_PX) + SWATCH
        if x and x + wide > width:
            x, line = 0, line + 1
        places.append((x, GAP + line * LABEL, word, color))
        x += wide
    picture: Picture = np.full((LABEL * (line + 1) + GAP, width, 3), draw.PAPER, np.uint8)
    for x, y, word, color in places:
        picture[y + 4 : y + 12, x : x + SWATCH - 6] = color
        draw.text(picture, word, (x + SWATCH, y), KEY_PX, draw.INK)
    return picture
