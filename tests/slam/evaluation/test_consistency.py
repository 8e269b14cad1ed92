# SPDX-License-Identifier: Apache-2.0
"""A run that agrees with itself, and one that does not."""

from dataclasses import replace

import numpy as np
import pytest

from slam.evaluation.consistency import KeptScans
from slam.frames import Float
from tests.world2d import Drive, World2D, frames, laser, office, office_loop


@pytest.fixture(scope="module")
def kept() -> tuple[KeptScans, Float]:
    """Scans of one round and a half through a corridor of 66 m, and the true poses."""
    once = office_loop()
    drive = Drive(once.start, (*once.pieces[:-1], *once.pieces[:4]))
    scans = KeptScans()
    poses = []
    for frame in frames(World2D(office()), drive, rate_hz=1.0, spec=laser(91), seed=2):
        assert frame.truth is not None
        scans.note(frame, frame.truth)
        poses.append(frame.truth)
    return scans, np.array(poses)


def test_true_poses_agree_to_the_noise_of_the_scanner(kept: tuple[KeptScans, Float]) -> None:
    scans, poses = kept
    found = scans.judged(poses)
    assert found is not None
    assert found.revisits > 20
    assert found.apart_cm is not None
    assert found.apart_cm < 5.0
    assert found.sharper_nats > 0.5


def test_drift_blurs_the_map_and_parts_the_visits(kept: tuple[KeptScans, Float]) -> None:
    """The more of it, the more; neighbours hardly notice."""
    scans, poses = kept
    apart, sharper, beside = [], [], []
    for drift in (0.0, 0.002, 0.005):
        turned = poses.copy()
        turned[:, 1] += drift * np.arange(len(poses))
        found = scans.judged(turned)
        assert found is not None
        apart.append(found.apart_cm)
        sharper.append(found.sharper_nats)
        beside.append(found.neighbours_cm)
    assert apart[0] < apart[1] < apart[2]
    assert sharper[0] > sharper[1] > sharper[2]
    assert beside[2] < 2.0 * beside[0]
    excess = scans.judged(poses)
    assert excess is not None
    assert excess.excess_cm is not None
    assert excess.block()["revisits"] == excess.revisits


def test_the_same_run_lying_elsewhere_agrees_as_well(kept: tuple[KeptScans, Float]) -> None:
    scans, poses = kept
    moved = poses + np.array([3.0, -7.0, 0.0])
    here, there = scans.judged(poses), scans.judged(moved)
    assert here is not None
    assert there is not None
    assert there.apart_cm == pytest.approx(here.apart_cm, rel=1e-6)


def test_of_two_scanners_the_scans_of_the_first_are_judged() -> None:
    front = laser(91)
    rear = replace(front, T_robot_laser=np.array([-0.3, 0.0, np.pi]))
    both = frames(
        World2D(office()), office_loop(), rate_hz=1.0, spec=[front, rear], apart_s=0.5, seed=2
    )
    found = []
    for stream in (both, both[::2]):
        scans = KeptScans()
        for frame in stream:
            scans.note(frame, np.asarray(frame.truth))
        found.append(scans.judged(np.array([frame.truth for frame in stream])))
    assert found[0] == found[1]
