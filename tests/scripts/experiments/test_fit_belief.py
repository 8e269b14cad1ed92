# SPDX-License-Identifier: Apache-2.0
"""The fit of the belief: on samples whose numbers are known, and along a log of known motion."""

import math

import numpy as np
import pytest

from scripts.experiments.explained import GOES_ON, PLACE, Drive, Sample
from scripts.experiments.fit_belief import Samples, fitted, left_out
from slam.tracker.belief.likelihood import ENDS
from tests.world2d import Drive as Way
from tests.world2d import World2D, frames, laser, rectangle

pytestmark = pytest.mark.slow
HALL = World2D(np.vstack([
    rectangle(-3.0, -2.0, 9.0, 4.0), rectangle(1.5, 1.0, 2.2, 2.0), rectangle(6.0, -1.5, 8.0, -1.0),
]))  # fmt: skip
LOGS = ("intel", "csail", "wean-1", "wean-2")  # three buildings
TRUE = np.array([3.0, 2.0, 5.0])


def samples_of(rng: np.random.Generator, count: int) -> list[Sample]:
    """Shares as likely right as ``TRUE`` has it."""
    found = []
    for k in range(count):
        kind = (PLACE, GOES_ON)[k % 2]
        logit = rng.uniform(-3.5, 3.5)
        share = (1.0 + ENDS) / (1.0 + math.exp(-logit)) - ENDS / (1.0 + math.exp(logit))
        z = TRUE[0] * logit + TRUE[1] - TRUE[2] * (kind == PLACE)
        found.append((kind, share, bool(rng.random() < 1.0 / (1.0 + math.exp(-z)))))
    return found


def test_the_numbers_that_made_the_samples_are_found():
    rng = np.random.default_rng(5)
    samples = Samples({log: samples_of(rng, 3000) for log in LOGS})
    samples.weight[:] = 1.0  # as they were drawn
    assert fitted(samples) == pytest.approx(TRUE, abs=0.35)
    p, others = left_out(samples)
    assert len(others) == 3  # both of a building are left out together
    assert float(np.mean(p[samples.right])) > 0.85 > 0.15 > float(np.mean(p[~samples.right]))


def test_a_right_pose_explains_more_than_a_wrong_one_and_going_on_more_than_being_carried():
    way = Way((0.0, 0.0, 0.0), ((0.5, 0.0, 12.0), (0.0, 0.5, 6.3), (0.5, 0.0, 12.0)))
    stream = frames(HALL, way, rate_hz=4.0, spec=laser(181), seed=3)
    drive = Drive([frame.stamp_ns for frame in stream[12::8]])
    for frame in stream:
        drive.take(frame)
    shares = {
        (kind, right): [s for k, s, r in drive.samples if (k, r) == (kind, right)]
        for kind in (PLACE, GOES_ON)
        for right in (True, False)
    }
    assert all(len(own) >= 4 for own in shares.values()), shares
    for kind in (PLACE, GOES_ON):
        assert np.median(shares[kind, True]) > 0.9 > np.median(shares[kind, False])
