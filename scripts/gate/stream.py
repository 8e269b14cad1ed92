# SPDX-License-Identifier: Apache-2.0
"""A recording of a track for a test: its frames, and what a SLAM makes of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from scripts.comparison import recording
from scripts.comparison.entry import scored
from scripts.gate.runs import LEVEL, SECONDS, One, of_tracks, recorded
from slam.frames import Frame
from slam.oracle import shown
from slam.replay import Track
from slam.shaped import Share, Table, shaped
from slam.system import SlamSystem
from slam.trajectory import Trajectory


class Mark(Table, frozen=True):
    """What the mark takes: a track, by name; a level; how many seeds; s of each run."""

    track: str
    level: Share = LEVEL
    seeds: Annotated[int, Meta(ge=1, le=1000)] = 1
    seconds: Annotated[float, Meta(ge=2.0, le=600.0)] = SECONDS


def asked(words: Sequence[Any], given: Mapping[str, Any]) -> list[One]:
    """The runs of a mark with these arguments; all that is wrong is a ``MobiliaError``."""
    names = (*Mark.__struct_fields__, *map(repr, words[len(Mark.__struct_fields__) :]))
    mark = shaped("mobilia", {**dict(zip(names, words, strict=False)), **given}, Mark)
    return of_tracks((mark.track,), mark.level, mark.seeds, mark.seconds)


@dataclass(frozen=True, kw_only=True)
class Run:
    """What became of a SLAM on a recording.

    lost_s         s from the start to the loss; None where it held
    error_m        root mean square position error, unaligned (ATE)
    drift_m_per_s  relative position error over each second (RPE)
    """

    name: str
    lost_s: float | None
    error_m: float
    drift_m_per_s: float

    @property
    def lost(self) -> bool:
        """Whether it lost its way."""
        return self.lost_s is not None

    def __repr__(self) -> str:
        held = "held" if self.lost_s is None else f"lost at {self.lost_s:.1f} s"
        return f"<{self.name}: {held}, {self.error_m:.3f} m off, {self.drift_m_per_s:.3f} m/s>"


class Recorded:
    """One recording, made in ``folder`` where it is not there yet.

    Iterating gives its frames as a SLAM may see them; ``truth`` has the true poses in the world.
    """

    def __init__(self, one: One, folder: Path) -> None:
        self.one = one
        self._drive = recording.load(recorded(one.job, folder))

    def __iter__(self) -> Iterator[Frame]:
        return (frame.without_truth() for frame in self._drive.frames)

    @cached_property
    def truth(self) -> Trajectory:
        """Of each frame."""
        return self._drive.truth()

    def run(self, slam: SlamSystem) -> Run:
        """Give it every frame, and print what became of it, with the command that shows it.

        Raises ``SlamFailedError``, from the SLAM's own.
        """
        track = Track(type(slam).__name__, slam)
        for frame in self._drive.frames:
            track.take(shown(slam, frame))
        row = scored(track, None, None, self.truth)
        run = Run(
            name=str(self.one), lost_s=row["lost_at_s"], error_m=row["ate_unaligned_m"],
            drift_m_per_s=row["rpe_m_per_s"],
        )  # fmt: skip
        kind = type(slam)
        print(run, self.one.blame(f"{kind.__module__}:{kind.__qualname__}"), sep="\n")
        return run
