# SPDX-License-Identifier: Apache-2.0
"""Poorer scanners from better ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scripts.experiments.parts import Part
from slam.errors import InvalidValueError
from slam.frames import Frame, LaserSpec, Odometry, Scan


def frames(count: int) -> list[Frame]:
    spec = LaserSpec(
        n_beams=361,
        angle_min=-math.pi / 2,
        angle_increment=math.radians(0.5),
        beam_time_offsets=np.arange(361) * 1e-5,
    )
    out = []
    for k in range(count):
        ranges = (1.0 + 0.02 * np.arange(361)).astype(np.float32)
        ranges[7] = np.nan
        out.append(
            Frame(
                stamp_ns=k,
                odometry=Odometry(stamp_ns=k, T_odom_robot=np.zeros(3)),
                scan=Scan(stamp_ns=k, ranges=ranges, spec=spec),
            )
        )
    return out


def test_beams_that_are_left_keep_direction_time_and_range():
    whole = frames(1)[0].scan
    poorer = Part(name="", every=2, fov_deg=90.0, range_m=4.0).of(frames(1))[0].scan
    assert poorer.spec.n_beams == 91
    kept = np.flatnonzero(np.isin(np.round(whole.spec.angles, 9), np.round(poorer.spec.angles, 9)))
    assert len(kept) == 91
    np.testing.assert_allclose(np.degrees(poorer.spec.angles[[0, -1]]), [-45.0, 45.0])
    np.testing.assert_array_equal(poorer.spec.beam_time_offsets, whole.spec.beam_time_offsets[kept])
    expected = whole.ranges[kept].copy()
    expected[expected > 4.0] = np.inf
    np.testing.assert_array_equal(poorer.ranges, expected)
    assert poorer.spec.range_max == 4.0


def test_scans_of_one_scanner_share_one_poorer_one_and_the_given_ones_stay():
    given = frames(3)
    poorer = Part(name="", every=4).of(given)
    assert len({id(f.scan.spec) for f in poorer}) == 1
    assert given[0].scan.spec.n_beams == 361
    assert np.isfinite(given[0].scan.ranges[8])


def test_a_spec_is_made_once_for_each_scanner(monkeypatch):
    made, inner = [], Part._spec
    monkeypatch.setattr(Part, "_spec", lambda self, spec: made.append(spec) or inner(self, spec))
    Part(name="").of(frames(3))
    assert len(made) == 1


def test_a_part_without_a_beam_is_refused():
    with pytest.raises(InvalidValueError, match=r"Part\.fov_deg .* got 1 with one beam of 7"):
        Part(name="", every=7, fov_deg=1.0).of(frames(1))


@pytest.mark.parametrize(
    "wrong",
    [
        {"every": 0}, {"every": 2.5}, {"every": "2"}, {"every": True}, {"fov_deg": -3.0},
        {"fov_deg": "90"}, {"range_m": math.nan},
    ],
)  # fmt: skip
def test_parts_that_cannot_be_are_refused(wrong):
    with pytest.raises(InvalidValueError, match=next(iter(wrong))):
        Part(name="", **wrong)
