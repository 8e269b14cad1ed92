# SPDX-License-Identifier: Apache-2.0
"""Filming: every frame through every SLAM, and pictures when they are due."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence

from rich.markup import escape

from scripts import interrupt
from scripts.console import progress
from scripts.film.encode import Film
from scripts.film.show import Show
from sim.view.draw import Picture
from slam.errors import InvalidValueError
from slam.frames import BeamClass, Frame, Stream


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
        if list(self._seconds) != sorted(self._seconds):
            raise InvalidValueError(f"moments must be in rising order, got {list(seconds)}")
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
