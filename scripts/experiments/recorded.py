# SPDX-License-Identifier: Apache-2.0
"""Streams that an experiment simulates once and keeps in a folder."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from scripts import workers
from scripts.comparison.recording import record
from slam.files import make_folder, replacing


class RecordedStream(ABC):
    """A stream with a file of its own: a second run simulates nothing."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Of its file, without the ending."""

    @abstractmethod
    def simulated(self) -> dict[str, Any]:
        """What ``scripts.comparison.recording.record`` is told, but for the path."""

    def path(self, folder: Path) -> Path:
        """Where it is kept."""
        return folder / f"{self.name}.npz"

    def make(self, folder: Path) -> None:
        """Simulate it, unless it is there."""
        path = self.path(folder)
        if not path.exists():
            with replacing(path) as part:
                record(part, **self.simulated())


def make_missing(streams: Sequence[RecordedStream], folder: Path, jobs: int) -> None:
    """Make the folder, and simulate the streams that are not in it yet."""
    make_folder(folder)
    missing = [stream for stream in streams if not stream.path(folder).exists()]
    for _ in workers.each(partial(_make, folder=folder), missing, jobs=jobs):
        pass


def _make(stream: RecordedStream, folder: Path) -> None:
    stream.make(folder)
