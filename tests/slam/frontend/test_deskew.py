# SPDX-License-Identifier: Apache-2.0
"""De-skew against the exact arc, for the one rule that every user shares."""

import numpy as np
import pytest

from slam import se2
from slam.frames import LaserSpec, Scan
from slam.frontend.deskew import end_points
from slam.frontend.observations import from_scan
from slam.shunting.slam import ShuntingConfig

SPEC = LaserSpec(
    n_beams=7, angle_min=-1.5, angle_increment=0.5, T_robot_laser=np.array([0.3, -0.1, 0.2]),
    beam_time_offsets=np.linspace(0.0, 0.1, 7), range_max=20.0,
)  # fmt: skip
RANGES = np.array([2.0, 5.0, 3.0, 1.0, 4.0, 8.0, 6.0])


def ends(twist: np.ndarray) -> np.ndarray:
    return end_points(
        RANGES, SPEC.angles, SPEC.beam_time_offsets, SPEC.T_robot_laser, np.asarray(twist)
    )


def on_the_arc(twist: np.ndarray) -> np.ndarray:
    out = []
    for r, angle, offset in zip(RANGES, SPEC.angles, SPEC.beam_time_offsets, strict=True):
        T_robot_laser = se2.compose(se2.exp(twist, offset), SPEC.T_robot_laser)
        ray = np.array([[r * np.cos(angle), r * np.sin(angle)]])
        out.append(se2.transform(T_robot_laser, ray)[0])
    return np.array(out)


@pytest.mark.parametrize("twist", [(1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, -0.2, 1.5)])
def test_ends_lie_where_the_arc_of_the_robot_puts_them(twist):
    """Within the third order: v t (omega t)^2 / 24, here 0.1 m times 0.15^2 / 24."""
    off = ends(np.array(twist)) - on_the_arc(np.array(twist))
    assert np.abs(off).max() < 1.1e-4
    first_order = 0.5 * np.hypot(*twist[:2]) * 0.1 * abs(twist[2]) * 0.1
    assert np.abs(off).max() <= max(0.02 * first_order, 1e-12)


def test_beams_and_corners_share_one_rule():
    """Bit for bit: what the map sees and what corners are made of lie in the same places."""
    scan = Scan(stamp_ns=0, ranges=RANGES.astype(np.float32), spec=SPEC)
    twist = np.array([0.7, 0.1, -1.2])
    seen = from_scan(scan, twist, ShuntingConfig()).points_robot
    every = ends(twist)
    assert len(seen) > 3
    for point in seen:
        assert (every == point).all(axis=1).any()


def test_what_has_no_range_has_no_end():
    gone = end_points(
        np.full(7, np.nan), SPEC.angles, SPEC.beam_time_offsets, SPEC.T_robot_laser, np.ones(3)
    )
    assert np.isnan(gone).all()
