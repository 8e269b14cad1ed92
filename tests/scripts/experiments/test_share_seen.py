# SPDX-License-Identifier: Apache-2.0
"""What is seen of a level."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.experiments import share_seen
from slam.frames import BeamClass

N, S, SEMI, M = (int(kind) for kind in BeamClass)


def test_shares_are_of_the_beams_that_met_something():
    kinds = np.zeros((3, 4), dtype=np.int64)
    kinds[0, [N, S, SEMI, M]] = 5, 2, 1, 1  # a quarter moves, half can move
    kinds[1, N] = 9  # nothing met: no share
    kinds[2, S] = 3
    found = share_seen.shares(kinds)
    assert found["moving"] == pytest.approx(0.125)
    assert found["movable"] == pytest.approx(0.25)
    assert found["moving_p90"] == pytest.approx(0.225)
    assert math.isnan(share_seen.shares(kinds[1:2])["moving"])


class Room:
    """A robot (body 0), a chair (1), a person (2) and a door of 1 m (3), where a test puts them."""

    def __init__(self) -> None:
        kinds = ("robot", "chair", "person", "door")
        movers = [SimpleNamespace(kind=kind, radius=1.0) for kind in kinds]
        self.scene = SimpleNamespace(movers=movers)
        self.bodies = SimpleNamespace(mover_of_body=np.arange(4))
        self.poses, self.time_ns = np.zeros((4, 3)), 0

    def mover_poses(self) -> np.ndarray:
        return self.poses

    def look(self, count: share_seen.Resightings, seconds: float, *bodies: int) -> tuple[int, int]:
        """Two beams on each of ``bodies``, one on the chair as well: too few to see it."""
        self.time_ns = round(seconds * 1e9)
        labels = SimpleNamespace(body=np.array([*bodies, *bodies, 1, -1], dtype=np.int32))
        count.look(SimpleNamespace(labels=labels))  # type: ignore[arg-type]
        return count.again, count.elsewhere


def test_change_is_counted_when_a_thing_comes_back_into_view():
    room = Room()
    count = share_seen.Resightings(room, away_s=5.0)  # type: ignore[arg-type]
    assert room.look(count, 0.0, 1, 2, 3) == (0, 0)  # seen for the first time
    room.poses[1:, 0] = 0.2
    assert room.look(count, 4.0, 1) == (0, 0)  # away for too short a time, but a sighting
    assert room.look(count, 9.5, 1) == (1, 0)  # there since
    room.poses[1, 0] = 0.35
    assert room.look(count, 15.0) == (1, 0)  # one beam is no sighting
    assert room.look(count, 16.0, 1) == (2, 1)
    room.poses[3] = 0.0, 0.0, 0.3  # the door turned: its leaf is 0.15 m off
    assert room.look(count, 20.0, 2, 3) == (3, 2)  # the person does not count


@pytest.mark.parametrize("scene", ["arena", "corridor"])
def test_what_is_seen_grows_in_a_line_with_the_motion(scene: str):
    seen = []
    for level in (0.5, 1.0):
        rows = [
            share_seen.measure({
                "scene": scene, "level": level, "seed": seed, "axis": "motion", "seconds": 16.0,
                "scanner": "scanner(fov_deg=180,beams=61,rate_hz=2.5,sigma_m=0.01)", "away": 5.0,
            })
            for seed in (500, 501, 502)
        ]  # fmt: skip
        seen.append(np.mean([row["moving"] for row in rows]))
        assert np.mean([row["blocked"] for row in rows]) < 0.15
    assert seen[1] > 0.3
    assert abs(seen[0] - 0.5 * seen[1]) < 0.2 * seen[1]
