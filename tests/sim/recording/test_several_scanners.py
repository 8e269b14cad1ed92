# SPDX-License-Identifier: Apache-2.0
"""A robot with several scanners: what each sees, and that the world is as with one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.core.sight import Eye, hidden, view_of
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.recording.verify import regenerate
from sim.simulation import Simulation, stream, tour
from sim.twins.twins import Twins
from sim.world.robots import read_robot
from slam.errors import InvalidValueError
from slam.frames import Frame
from slam.logs import read_bag
from slam.logs.together import together

pytestmark = pytest.mark.slow
BEHIND = {"x_m": -0.2, "y_m": 0.05, "yaw_deg": 180.0}


def driven(name: str, seconds: float = 2.0, **settings: object) -> list[Frame]:
    simulation = Simulation(
        "office", seed=3, dynamism=0.8, change=0.0, laser=name, labels=True, **settings
    )
    return list(tour(simulation, seconds))


@pytest.mark.parametrize("name", ["full", "tim561:noise"])  # tim561: scans begin between two steps
def test_the_world_and_the_first_scanner_are_those_of_a_robot_with_one(name: str) -> None:
    alone, both = driven(name), driven(name, also_at=[BEHIND])
    for one, first, other in zip(alone, both[::2], both[1::2], strict=True):
        assert one.truth.tobytes() == first.truth.tobytes() == other.truth.tobytes()
        assert (one.scan, one.labels) == (first.scan, first.labels)
        poses = [frame.odometry.T_odom_robot.tobytes() for frame in (one, first, other)]
        assert len(set(poses)) == 1
        assert other.stamp_ns == first.stamp_ns + 1 == one.stamp_ns + 1
        assert other.scan.spec == replace(first.scan.spec, T_robot_laser=other.scan.spec.mount)


@pytest.mark.parametrize("name", ["full", "tim561:ideal"])
def test_the_other_sees_what_a_first_would_see_from_there(name: str) -> None:
    tables = read_robot("turtlebot3")
    height = {"height_m": tables["scanner"]["height_m"]}
    ahead, behind = ({**tables, "scanner": {**at, **height}} for at in ({"x_m": 0.1}, BEHIND))
    other = driven(name, robot=ahead, also_at=[BEHIND])[1::2]
    for frame, wanted in zip(other, driven(name, robot=behind), strict=True):
        np.testing.assert_allclose(frame.scan.spec.mount, wanted.scan.spec.mount, atol=1e-12)
        assert np.mean(frame.labels.body == wanted.labels.body) > 0.98  # noise loses others
        both = np.isfinite(frame.scan.ranges) & np.isfinite(wanted.scan.ranges)
        apart = np.abs(frame.scan.ranges - wanted.scan.ranges)[both]
        assert np.median(apart) < 0.02
        if name.endswith("ideal"):
            assert np.quantile(apart, 0.99) < 0.002


def test_nothing_is_moved_that_either_can_see() -> None:
    here, walls = np.zeros(3), np.zeros((0, 5))
    ahead = Eye(mounted=np.zeros(3), half=0.5, reach=20.0)
    behind = replace(ahead, mounted=np.array([0.0, 0.0, np.pi]))
    for eyes, unseen in (([ahead], {"back", "side"}), ([ahead, behind], {"side"})):
        view = view_of(eyes, here, walls)
        places = {"front": (3.0, 0.0), "back": (-3.0, 0.0), "side": (0.0, 3.0)}
        assert {name for name, at in places.items() if hidden(view, *at, 0.3)} == unseen


def test_a_bag_gives_the_frames_of_the_tour_and_is_made_again(tmp_path: Path) -> None:
    recipe = Recipe(scene="arena", seed=2, dynamism=0.5, seconds=4.0, also_at=[BEHIND])
    record(recipe, tmp_path)
    path = tmp_path / recipe.name
    streams = [read_bag(path, scan=topic, labels=True) for topic in ("/scan", "/scan_2")]
    wanted = list(tour(Simulation(**recipe.simulation()), recipe.seconds))
    for frame, of_tour in zip(together(streams), wanted, strict=True):
        spec = replace(of_tour.scan.spec, range_sigma_m=0.0)
        assert frame == replace(of_tour, scan=replace(of_tour.scan, spec=spec))
    assert [frame.stamp_ns for frame in read_bag(path)] == [f.stamp_ns for f in wanted[::2]]
    assert regenerate(path).verdict == "same bytes"


def test_it_goes_on_from_its_state_bit_for_bit() -> None:
    settings = {"seed": 1, "laser": "tim561", "labels": True, "also_at": [BEHIND]}
    one, again = Simulation("arena", **settings), Simulation("arena", **settings)
    for _ in range(3):
        one.observe()
    again.load_state(one.save_state())
    for _ in range(4):
        assert one.observe() == again.observe()
        assert one.frames_of_others == again.frames_of_others
    alone = Simulation("arena", seed=1, laser="tim561", labels=True)
    with pytest.raises(InvalidValueError, match="the state is of scanner"):
        alone.load_state(one.save_state())


def test_what_cannot_be_is_refused() -> None:
    for wrong, match in (
        ([], "also_at must be a list of 1 to 7 places"),
        ([{"x_m": 0.1 * k} for k in range(8)], "also_at must be a list of 1 to 7 places"),
        ([{"x_m": 3.0}], r"also_at\[0\].x_m must be a number from -1 to 1, got 3"),
        ([BEHIND, BEHIND], "two scanners of a robot are at"),
        ([{"x": 0.1}], "also_at"),
    ):
        with pytest.raises(InvalidValueError, match=match):
            Simulation("arena", also_at=wrong)
    with pytest.raises(InvalidValueError, match="baud is of one scanner"):
        stream("arena", seconds=1.0, baud=38400, also_at=[BEHIND])
    with pytest.raises(InvalidValueError, match="Twins take no also_at"):
        Twins("arena", also_at=[BEHIND])
    with pytest.raises(InvalidValueError, match=r"Recipe.also_at and twin exclude"):
        Recipe(scene="arena", seed=0, dynamism=0.0, seconds=1.0, twin="static", also_at=[BEHIND])
