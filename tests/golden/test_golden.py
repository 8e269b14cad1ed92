# SPDX-License-Identifier: Apache-2.0
"""Results are what they were: bit for bit on the same versions.

What is recorded is so on every processor; estimates on those with fused multiply-add (x86-64-v3),
where the C library's sines round as they did.
"""

from typing import Any

import numpy as np
import pytest

from sim.recording.recipe import made_with
from slam.evaluation import metrics
from slam.trajectory import Trajectory
from tests.golden.digests import MAKERS, TOLERANCE, Missing, on_intel, read

pytestmark = pytest.mark.golden
GOLDEN = read()
RECORDED = ("frames/", "episode", "film")  # the rest are of SLAMs
FUSED = "X86_V3"


def test_every_result_is_on_file_and_nothing_else():
    assert sorted(GOLDEN["results"]) == sorted(MAKERS)


@pytest.mark.parametrize("name", MAKERS)
def test_results_are_what_they_were(name: str):
    want = GOLDEN["results"][name]
    try:
        got = MAKERS[name]()
    except Missing as error:
        pytest.skip(str(error))
    for key in sorted(set(want) - {"sha256"}):
        np.testing.assert_allclose(got[key], want[key], rtol=0.0, atol=TOLERANCE, err_msg=key)
    if elsewhere := _elsewhere(recorded=name.startswith(RECORDED)):
        pytest.skip(f"the numbers agree; the digests were made with another {elsewhere}")
    assert got["sha256"] == want["sha256"]


def test_the_online_path_of_intel_stays_near_the_corrected_one():
    """Beside its digest, for it is the longest of the runs."""
    try:
        _, seen = on_intel("shunting", 910)
    except Missing as error:
        pytest.skip(str(error))
    stamps_ns = np.array([frame.stamp_ns for frame, _ in seen])
    true, wheels, believed = (
        Trajectory(stamps_ns=stamps_ns, poses=np.array(poses))
        for poses in zip(
            *((frame.truth, frame.odometry.T_odom_robot, e.T_map_robot) for frame, e in seen),
            strict=True,
        )
    )
    assert len(true) == 910
    assert metrics.ate(wheels, true, align="se2").value > 10.0
    assert metrics.ate(believed, true, align="se2").value <= 0.12


def _elsewhere(*, recorded: bool) -> str:
    """What differs here from where the digests were made; the version of mobilia decides no bit."""
    changes = []
    for key, there in GOLDEN["made_with"].items():
        here: Any = made_with()[key]
        if key == "versions":
            here, there = ({k: v for k, v in x.items() if k != "mobilia"} for x in (here, there))
        if key == "cpu":
            here, there = (recorded or FUSED in x.split() for x in (here, there))
        if here != there:
            changes.append(key)
    return ", ".join(changes)
