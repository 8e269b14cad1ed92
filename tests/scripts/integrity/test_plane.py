# SPDX-License-Identifier: Apache-2.0
"""The plane: beams against distances by hand, wheels against sampling, same seed same bytes."""

import hashlib
import math
from itertools import pairwise

import numpy as np
import pytest

from scripts.integrity import driving
from scripts.integrity.geometry import first_hits
from scripts.integrity.kinds import KINDS, LAYOUTS, StreamSpec
from scripts.integrity.layouts import CLEAR_M, layout
from scripts.integrity.movers import KEEP_M
from scripts.integrity.plane import frames, world
from slam import se2
from slam.errors import InvalidValueError
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


@pytest.mark.parametrize("name", [*LAYOUTS, "bare"])
def test_ways_keep_clear_of_walls_and_lead_everywhere(name):
    for seed in range(20):
        plan = layout(name, np.random.default_rng([seed, 0]))
        for i, j in plan.edges:
            along = np.linspace(0.0, 1.0, 41)[:, None]
            points = plan.nodes[i] + along * (plan.nodes[j] - plan.nodes[i])
            assert clear_m(points, plan) > CLEAR_M, (seed, i, j)
        reached = {0}
        for _ in plan.nodes:
            reached |= {b for i, j in plan.edges for a, b in ((i, j), (j, i)) if a in reached}
        assert len(reached) == len(plan.nodes)
        assert 10.0 < np.ptp(plan.walls[:, ::2]) < 22.0


def clear_m(points, plan) -> float:
    a, b = plan.walls[:, :2], plan.walls[:, 2:]
    t = np.einsum("pwk,wk->pw", points[:, None] - a, b - a) / ((b - a) ** 2).sum(axis=1)
    nearest = a + np.clip(t, 0.0, 1.0)[..., None] * (b - a)
    least = np.linalg.norm(points[:, None] - nearest, axis=2).min()
    for x, y, radius in plan.pillars:
        least = min(least, (np.linalg.norm(points - (x, y), axis=1) - radius).min())
    return float(least)


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


@pytest.mark.parametrize("kind", ["boards10", "crowd16", "chairs24"])
def test_things_keep_off_walls_and_the_robot(kind):
    known = world(StreamSpec(kind=kind, seed=6, seconds=40.0))
    assert clear_m(known.robot[:, :2], known.layout) > 0.3
    near = []
    for i, (half, radius) in enumerate(known.things[["half", "radius"]]):
        at = known.poses[::5, i]
        way = np.column_stack([np.cos(at[:, 2]), np.sin(at[:, 2])])
        line = [at[:, :2] + share * half * way for share in np.linspace(-1.0, 1.0, 21)]
        assert clear_m(np.vstack(line), known.layout) > radius - 1e-6
        away = [np.linalg.norm(p - known.robot[::5, :2], axis=1).min() - radius for p in line]
        near.append(min(away))
    assert min(near) > KEEP_M - 0.05
    assert known.moving.any(axis=0).all()


def test_a_wrong_spec_is_refused():
    for more, says in (
        ({"kind": "quite"}, "kind must be one of quiet"),
        ({"changes": (("chair", 3),)}, "changes must be one of chairs"),
        ({"changes": (("rate_hz", 0.0),)}, r"Kind.rate_hz must be a number from 0.1 to 100, got 0"),
        ({"seconds": 0.0}, "seconds must be a number from 1 to 3600"),
    ):
        with pytest.raises(InvalidValueError, match=says):
            frames(StreamSpec(**{"kind": "quiet", "seed": 1, **more}))
    assert {spec.layout for spec in KINDS.values()} == {"", "halfturn", "bare"}
