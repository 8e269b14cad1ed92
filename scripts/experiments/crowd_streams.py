# SPDX-License-Identifier: Apache-2.0
"""Recordings of crowds on train seeds, kept in a folder: a second run simulates nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scripts.experiments.recorded import RecordedStream
from slam.errors import InvalidValueError

SCENES = ("office", "arena", "gallery", "station")
TRAIN = {1.0: range(8), 0.75: range(8, 14), 0.5: range(14, 20)}  # seeds of each motion
EVERY = 8  # of the scans at 37.5 Hz


@dataclass(frozen=True, kw_only=True)
class CrowdStream(RecordedStream):
    """A tour among a scene's own crowd, with a scanner that errs by noise only."""

    scene: str
    motion: float
    seed: int
    seconds: float = 50.0
    every: int = EVERY

    @property
    def name(self) -> str:
        """Of its file, without the ending."""
        return (
            f"{self.scene}_motion{self.motion:g}_seed{self.seed}_{self.seconds:g}s_{self.every}th"
        )

    def simulated(self) -> dict[str, Any]:
        """Its recipe: the crowd alone, nothing changes places."""
        return {
            "every": self.every, "scene": self.scene, "seed": self.seed, "dynamism": self.motion,
            "motion": self.motion, "change": 0.0, "seconds": self.seconds, "scanner": "noise",
        }  # fmt: skip


def train_streams(
    scenes: Sequence[str] = SCENES, motions: Sequence[float] = tuple(TRAIN), most: int = 20
) -> list[CrowdStream]:
    """At most so many seeds of each scene and motion; ``InvalidValueError`` for another motion."""
    for motion in motions:
        if motion not in TRAIN:
            known = ", ".join(f"{m:g}" for m in TRAIN)
            raise InvalidValueError(f"motion must be one of {known}, got {motion:g}")
    return [
        CrowdStream(scene=scene, motion=motion, seed=seed)
        for motion in motions
        for seed in list(TRAIN[motion])[:most]
        for scene in scenes
    ]
