# SPDX-License-Identifier: Apache-2.0
"""Loops of long runs."""

from __future__ import annotations

import numpy as np
import pytest

from slam import se2
from slam.frames import Frame
from slam.shunting import ShuntingConfig
from slam.shunting import loops as loops_module
from slam.shunting.impressions import Observations, from_scan
from slam.shunting.loops import Loops
from slam.shunting.matching import Matcher
from tests.world2d import Drive, World2D, frames, laser, office, office_loop

CONFIG = ShuntingConfig(cell_m=0.05)


def seen(frame: Frame) -> Observations:
    assert frame.scan is not None
    return from_scan(frame.scan, np.zeros(3), CONFIG)


def test_a_drifted_way_is_bent_back_onto_itself() -> None:
    """Once round the office and 10 m on, with a heading that creeps: 1 m off at the end."""
    once = office_loop()
    drive = Drive(once.start, (*once.pieces, (0.8, 0.0, 12.0)))
    stream = frames(World2D(office()), drive, rate_hz=1.0, spec=laser(181), seed=3)
    graph = Loops(CONFIG, Matcher(CONFIG))
    drifted, truth = [np.zeros(3)], [np.zeros(3)]
    before = stream[0]
    assert before.truth is not None
    graph.add(0, drifted[0], np.zeros(3), np.zeros((3, 3)), seen(before))
    for k, frame in enumerate(stream[1:], 1):
        assert before.truth is not None
        assert frame.truth is not None
        motion = se2.between(before.truth, frame.truth) + np.array([0.002, 0.0, 0.0008])
        truth.append(se2.between(stream[0].truth, frame.truth))  # type: ignore[arg-type]
        drifted.append(se2.compose(drifted[-1], motion))
        graph.add(k, drifted[-1], motion, np.diag([1e-4, 1e-4, 1e-6]), seen(frame))
        before = frame
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loops_module, "LONG_M", 50.0)
        corrected = graph.corrected(np.array(drifted))
    assert len(graph.edges) >= 3
    error = np.hypot(*(np.array(drifted) - truth)[:, :2].T)
    left = np.hypot(*(corrected - np.array(truth))[:, :2].T)
    assert error[-1] > 0.3
    assert left[-1] < 0.12
    assert left.max() < 0.6 * error.max()


def test_short_ways_stay_as_they_are() -> None:
    graph = Loops(CONFIG, Matcher(CONFIG))
    poses = np.zeros((4, 3))
    assert graph.corrected(poses) is poses
