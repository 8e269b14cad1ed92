# SPDX-License-Identifier: Apache-2.0
"""What is served: a scene with its robot, or a log, and the SLAMs that run on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.film.footage import of_log
from scripts.live.hands import Hands
from scripts.live.session import Room, Session, stamps_of
from sim.simulation import Simulation, n_frames
from slam.errors import NeedsLabelsError
from slam.frames import Stream
from slam.oracle import Oracle
from slam.replay import Replay, systems_named

Opened = tuple[Session, tuple[int, int]]
"""A session, and first and last stamp of its time line, ns."""


def of_scene(slams: Sequence[str], settings: Mapping[str, Any], seconds: float) -> Opened:
    """A world that lives for ``seconds``; ``settings`` as ``Simulation`` takes them."""
    simulation = Simulation(**settings, labels=True)
    room = Room(Hands(simulation))
    stream = Stream(
        metadata=simulation.metadata(),
        frames=lambda: room.frames(seconds),
        length=n_frames(seconds, simulation.scan_period_s),
    )
    return Session(stream, Replay.of(systems_named(slams)), room), stamps_of(0, seconds)


def of_file(slams: Sequence[str], path: Path) -> Opened:
    """A log or a bag.

    Raises ``NeedsLabelsError`` for an oracle on one without labels, ``LogFormatError`` for a file
    that cannot be read.
    """
    footage = of_log(path)
    replay = Replay.of(systems_named(slams))
    for name, track in replay.tracks.items():
        if isinstance(track.system, Oracle) and not footage.stage.labelled:
            raise NeedsLabelsError(f"{name}: {footage.title} has no labels to take returns out by")
    first = next(iter(footage.stream))
    return Session(footage.stream, replay), stamps_of(first.stamp_ns, footage.duration_s)
