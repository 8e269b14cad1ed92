# SPDX-License-Identifier: Apache-2.0
"""Drives of tracks that are simulated once and kept in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from scripts import workers
from scripts.benchmark.tracks import chosen
from scripts.comparison.recording import record
from scripts.experiments.shared import on_stream
from slam.files import make_folder, replacing


@dataclass(frozen=True, kw_only=True)
class Stream:
    """A track at a level with a seed, in a file of its own: a second run simulates nothing."""

    track: str
    level: float
    seed: int

    @property
    def name(self) -> str:
        """Of its recording, without the ending."""
        return f"{self.track}_{self.level:g}_s{self.seed}"

    def path(self, folder: Path) -> Path:
        """Where it is kept."""
        return folder / f"{self.name}.npz"

    def simulated(self) -> dict[str, Any]:
        """The recipe of the track, and one scan of how many is kept."""
        every = chosen([self.track])[0].every
        return {"every": every, **on_stream(self.track, self.level, self.seed, 0.0)}


def make_missing(streams: Sequence[Stream], folder: Path, jobs: int) -> None:
    """Make the folder, and simulate the streams that are not in it yet."""
    make_folder(folder)
    missing = [stream for stream in streams if not stream.path(folder).exists()]
    for _ in workers.each(partial(_make, folder=folder), missing, jobs=jobs):
        pass


def _make(stream: Stream, folder: Path) -> None:
    with replacing(stream.path(folder)) as part:
        record(part, **stream.simulated())
