# SPDX-License-Identifier: Apache-2.0
"""What counts as admitted in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scripts.metrics.judged import DUE_S, Judged
from slam.errors import InvalidValueError
from slam.estimate import Estimate
from slam.frames import NS_PER_S
from slam.trajectory import Trajectory

N, STEP_S = 40, 0.25


def run(off_m: float, since: int, until: int, sigma_m: float, converged: bool = True) -> Judged:
    """Off by so much to the side from one scan to before another."""
    stamps = np.round(np.arange(N) * STEP_S * NS_PER_S).astype(np.int64)
    truth, poses = np.zeros((N, 3)), np.zeros((N, 3))
    truth[:, 0] = poses[:, 0] = np.arange(N)
    poses[since:until, 1] = off_m
    covariance = np.diag([sigma_m**2] * 3)
    estimates = [
        Estimate(
            stamp_ns=int(stamp), T_map_robot=pose, covariance=covariance, converged=converged
        )
        for stamp, pose in zip(stamps, poses, strict=True)
    ]  # fmt: skip
    return Judged(
        estimate=Trajectory(stamps_ns=stamps, poses=poses),
        truth=Trajectory(stamps_ns=stamps, poses=truth),
        estimates=estimates,
        covariances=np.array([covariance] * N),
    )


def test_an_error_is_due_after_a_while_and_until_it_ends() -> None:
    due = run(0.15, 10, 30, 0.01).is_due()
    first = 10 + round(DUE_S / STEP_S)
    assert np.flatnonzero(due).tolist() == list(range(first, 30))
    assert not run(0.15, 10, first, 0.01).is_due().any()
    assert not run(0.05, 10, 30, 0.01).is_due().any()


def test_it_is_told_by_the_covariance_or_by_not_being_converged() -> None:
    silent = run(0.15, 10, 30, 0.01)
    assert np.flatnonzero(~silent.is_told()).tolist() == list(range(10, 30))
    assert silent.silent_share() == pytest.approx(20 / N)
    assert run(0.15, 10, 30, 0.051).is_told().all()
    assert run(0.15, 10, 30, 0.01, converged=False).is_told().all()
    with pytest.raises(InvalidValueError, match="covariances"):
        replace(silent, covariances=None).is_told()
