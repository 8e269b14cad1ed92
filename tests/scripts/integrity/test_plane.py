# SPDX-License-Identifier: Apache-2.0
"""The plane: beams against distances by hand, wheels against sampling, same seed same bytes."""

import hashlib
import math
from itertools import pairwise

import numpy as np
import pytest

from scripts.integrity import driving
from scripts.integrity.geometry import first_hits
from scripts.integrity.kinds import StreamSpec
from scripts.integrity.plane import frames
from slam import se2
from slam.frames import BeamClass


def looked(pose, angles, segments, discs):
    ranges, hit = np.zeros(len(angles)), np.zeros(len(angles))
    segments = np.array([(*one, 10.0 + k) for k, one in enumerate(segments)]).reshape(-1, 5)
    discs = np.array([(*one, 20.0 + k) for k, one in enumerate(discs)]).reshape(-1, 4)
    first_hits(np.array(pose, float), np.array(angles), segments, discs, ranges, hit)
    return ranges, hit


def test_beams_end_where_geometry_says():
    wall, disc = (3.0, -5.0, 3.0, 5.0), (0.0, 2.0, 0.5)
    angles = [0.0, math.pi / 4, math.atan2(1.0, 3.0), math.pi / 2, math.pi]
    ranges, hit = looked((0, 0, 0), angles, [wall], [disc])
    np.testing.assert_allclose(ranges[:4], [3.0, 3.0 * math.sqrt(2), math.sqrt(10.0), 1.5])
    assert (hit.tolist(), ranges[4] > 1e6) == ([10, 10, 10, 20, -2], True)
    # the same room seen from elsewhere, turned: beam 0 looks at the disc's middle from 2.5 m
    ranges, _ = looked((-1.5, 0.0, math.atan2(2.0, 1.5)), [0.0], [wall], [disc])
    np.testing.assert_allclose(ranges, [2.0])
    near = (1.0, -0.5, 1.0, 0.5)  # hides what is farther, up to its edges
    for order in ([near, wall], [wall, near]):
        ranges, _ = looked((0, 0, 0), [0.0, math.atan(0.499), math.atan(0.501)], order, [])
        along = ranges * np.cos(np.arctan([0.0, 0.499, 0.501]))
        np.testing.assert_allclose(along, [1.0, 1.0, 3.0])
    ranges, hit = looked((0, 2, 0), [0.0], [], [disc])
    assert (hit[0], ranges[0] > 1e6) == (-2, True)  # from within a disc: not seen


@pytest.mark.parametrize("model", ["fifth", "biased", "stated", "good"])
def test_wheels_err_as_their_model_says(model):
    d, turn, n = 0.04, 0.03, 6000
    path = np.zeros((n, 3))
    for k in range(1, n):
        path[k] = se2.compose(path[k - 1], [d, 0.0, turn])
    poses, stated = driving.odometry(path, model, np.random.default_rng(5))
    steps = np.array([se2.between(a, b) for a, b in pairwise(poses)])
    share = 0.02 if model == "good" else 0.2
    per_m = 0.002 if model == "good" else 0.02
    sigma = np.array([share * d, share * d, math.hypot(share * turn, per_m * d)])
    gain = (0.98, 1.04) if model == "biased" else (1.0, 1.0)
    np.testing.assert_allclose(steps.std(axis=0), sigma, rtol=0.04)
    mean = [gain[0] * d, 0.0, gain[1] * turn]
    assert (np.abs(steps.mean(axis=0) - mean) < 4.0 * sigma / math.sqrt(n)).all()
    if model == "stated":
        np.testing.assert_allclose(stated[9], np.diag(sigma**2), rtol=1e-6)
    else:
        assert stated[9] is None


def test_one_seed_gives_the_same_bytes_and_another_others():
    digests = []
    for seed in (4, 5, 4):
        found = hashlib.sha256()
        for frame in frames(StreamSpec(kind="pass10", seed=seed, seconds=4.0)):
            for part in (frame.scan.ranges, frame.truth, frame.odometry.T_odom_robot):
                found.update(part.tobytes())
            found.update(frame.labels.kind.tobytes())
        digests.append(found.hexdigest())
    assert digests[0] == digests[2] != digests[1]


def test_noise_dropouts_and_labels_are_as_stated():
    def stream(**changes):
        told = (("layout", "hall"), *changes.items())
        return frames(StreamSpec(kind="chairs8", seed=1, seconds=20.0, changes=told))

    pairs = list(zip(stream(sigma_m=0.03, dropouts=0.05), stream(sigma_m=0.0), strict=True))
    errors = np.concatenate([a.scan.ranges - b.scan.ranges for a, b in pairs])
    gone = ~np.isfinite(errors)
    assert gone.mean() == pytest.approx(0.05, abs=0.005)
    assert errors[~gone].std() == pytest.approx(0.03, rel=0.02)
    kinds = np.concatenate([a.labels.kind for a, _ in pairs])
    assert ((kinds == BeamClass.NONE) == gone).all()
    assert set(kinds.tolist()) == set(map(int, BeamClass))
