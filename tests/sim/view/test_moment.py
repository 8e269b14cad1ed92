# SPDX-License-Identifier: Apache-2.0
"""What is told of a moment: the claim by its own covariance, the error beside it, no green lie."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.view.draw import AMBER, GREEN, INK, RED
from sim.view.moment import Moments, Shown
from slam import se2
from slam.estimate import Estimate


def shown(sigma_m, off_m=None, heading_rad=0.01, converged=True, **diagnostics) -> Shown:
    """Of a SLAM that is off by that much along x, with a narrower claim along y."""
    pose = np.array([3.0, 4.0, 0.5])
    estimate = Estimate(
        stamp_ns=0, T_map_robot=pose, converged=converged, diagnostics=diagnostics,
        covariance=np.diag([sigma_m, 0.5 * sigma_m, heading_rad]) ** 2,
    )  # fmt: skip
    return Shown(
        primary="it", number=0, seconds=0.0, frame=None, T_world_map=np.zeros(3),
        truth_map=None if off_m is None else pose - (off_m, 0.0, 0.0),
        estimates={"it": estimate}, placed=None, raster=None, landmarks=None, said=(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("moment", "claim", "off"),
    [
        (shown(0.012), ("tracking, ± 1.2 cm (1 σ)", GREEN), None),
        (shown(0.012, state="relocated"), ("relocated, ± 1.2 cm (1 σ)", GREEN), None),
        (shown(0.8, state="tracking"), ("unsure, ± 80.0 cm (1 σ)", AMBER), None),  # wide
        (shown(0.01, heading_rad=0.2), ("unsure, ± 1.0 cm (1 σ)", AMBER), None),  # or turned
        (shown(0.01, converged=False, state="frozen"), ("unsure, ± 1.0 cm (1 σ)", AMBER), None),
        (shown(5.0, 3.0, converged=False, state="lost"), ("lost, ± 5.00 m (1 σ)", RED),
         ("3.00 m off, 0.6 σ", INK)),
        (shown(0.01, 0.02), ("tracking, ± 1.0 cm (1 σ)", GREEN), ("2.0 cm off, 2.0 σ", INK)),
        (shown(0.05, 15.0), ("tracking, ± 5.0 cm (1 σ)", RED), ("15.00 m off, 300.0 σ", RED)),
        (shown(0.0, 0.02), ("tracking, no covariance", AMBER), ("2.0 cm off", INK)),
    ],
)  # fmt: skip
def test_a_pose_is_green_only_where_it_claims_to_be_known_and_the_truth_agrees(moment, claim, off):
    assert moment.told() == [claim, *([] if off is None else [off])]


def test_all_lies_in_the_map_once_a_session_has_found_where_it_began_there():
    place, truth = np.array([3.0, 1.0, 0.5 * np.pi]), np.array([9.0, 9.0, np.pi])
    system = SimpleNamespace(T_map_first=np.zeros(3))
    tracks = {name: SimpleNamespace(system=system, estimates=[]) for name in ("it", "odometry")}
    moments = Moments(SimpleNamespace(tracks=tracks))
    for k in range(3):
        step = np.array([float(k), 0.0, 0.0])
        found = k == 2
        system.T_map_first = place if found else np.zeros(3)
        for name, track in tracks.items():
            pose = se2.compose(place, step) if found and name == "it" else step
            track.estimates.append(Estimate(stamp_ns=k, T_map_robot=pose, covariance=np.eye(3)))
        there = se2.compose(truth, step)
        last = moments.note(SimpleNamespace(stamp_ns=k, truth=there, labels=None))
    np.testing.assert_allclose(last.error("it"), (0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(last.error("odometry"), (0.0, 0.0), atol=1e-12)
    way = [[3.0, 1.0], [3.0, 2.0], [3.0, 3.0]]
    for name in ("truth", "odometry"):
        np.testing.assert_allclose(moments.paths[name].points(), way, atol=1e-12)
