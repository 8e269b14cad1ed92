# SPDX-License-Identifier: Apache-2.0
"""A part of a tour is that part: the same scans where all stay, the same path where few do."""

import numpy as np
import pytest

from sim.moments import toured
from sim.simulation import Simulation
from sim.twins.cut import Cut
from slam.errors import InvalidValueError, UnknownNameError

pytestmark = pytest.mark.slow
ROOM = {"scene": "arena", "seed": 3, "n_chairs": 6, "n_people": 1, "dynamism": 1.0, "labels": True}
SECONDS, FIRST = 2.0, 38  # the scan at 1.013 s


def moments(**cut):
    simulation = Simulation(**ROOM)
    return simulation, list(Cut(**cut).moments(simulation, ROOM, SECONDS))


@pytest.fixture(scope="module")
def whole():
    return list(toured(Simulation(**ROOM), SECONDS))


def test_with_everybody_it_is_the_rest_of_the_tour_bit_for_bit(whole):
    _, part = moments(from_s=1.013)
    assert [moment.frame for moment in part] == [moment.frame for moment in whole[FIRST:]]


def test_fewer_scans_and_beams_are_some_of_them(whole):
    _, part = moments(from_s=1.013, every=3, beams=4)
    for thin, moment in zip(part, whole[FIRST::3], strict=True):
        scan, full = thin.frame.scan, moment.frame.scan
        np.testing.assert_array_equal(scan.ranges, full.ranges[::4])
        np.testing.assert_allclose(scan.spec.angles, full.spec.angles[::4])
        np.testing.assert_array_equal(thin.frame.labels.body, moment.frame.labels.body[::4])
        assert thin.frame.truth.tolist() == moment.frame.truth.tolist()


def test_the_others_are_out_and_the_robot_drives_the_same_path(whole):
    simulation, part = moments(from_s=1.013, keep=("chair2",))
    names = simulation.world.mover_names
    mover_of = simulation.world.bodies.mover_of_body
    for moment, before in zip(part, whole[FIRST:], strict=True):
        assert moment.frame.truth.tolist() == before.frame.truth.tolist()
        hit = mover_of[moment.frame.labels.body[moment.frame.labels.body >= 0]]
        assert {names[k] for k in hit if k >= 0} <= {"chair2"}
    row = names.index("chair2")
    np.testing.assert_array_equal(part[0].poses[row], whole[FIRST].poses[row])


def test_what_cannot_be_is_told():
    with pytest.raises(UnknownNameError, match="no mover is called 'chair9'"):
        moments(keep=("chair9",))
    with pytest.raises(InvalidValueError, match=r"cut\.from_s must be < 2 s, got 2"):
        moments(from_s=2.0)
    with pytest.raises(InvalidValueError, match=r"Cut\.every must be a whole number"):
        Cut(every=0)
