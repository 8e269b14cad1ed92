# SPDX-License-Identifier: Apache-2.0
"""SLAMs named with numbers: in ``create``, in maps on file, and by ``--set``."""

from dataclasses import dataclass
from typing import Any

import pytest

import slam
from slam.ekf.config import EkfConfig
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import Frame
from slam.odometry import OdometrySlam
from slam.set_numbers import with_set
from slam.settings import Settings, number
from slam.shunting import ShuntingConfig
from slam.tracker.tracker import Tracker
from slam.variants import named, parsed
from tests.world2d import Drive, World2D, arena, frames, laser


@dataclass(frozen=True, kw_only=True)
class OwnConfig(Settings):
    gain: float = number(0.5, "1", "of the correction", "my data sheet, p. 3", high=1.0)


class Own(OdometrySlam):
    config_class = OwnConfig

    def __init__(self, config: dict[str, Any] | None = None) -> None:
        super().__init__()
        self.config = OwnConfig().changed(config or {})


def tour() -> list[Frame]:
    drive = Drive((0.0, 0.0, 0.0), ((0.3, 0.4, 1.0),))
    return frames(World2D(arena()), drive, rate_hz=5.0, spec=laser(91), seed=3)


def test_a_name_carries_numbers_there_and_back() -> None:
    name = "shunting{matching.local.points=90,objective=log,reward=7.5}"
    base, changes = parsed(name)
    assert (base, changes) == (
        "shunting", {"matching.local.points": 90, "objective": "log", "reward": 7.5}
    )  # fmt: skip
    assert named(base, changes) == name
    assert parsed("pipe:./slam {a=1}") == ("pipe:./slam {a=1}", {})
    for wrong in ("shunting{", "shunting{}", "shunting{a}", "shunting{a=1,a=2}", "shunting{=1}"):
        with pytest.raises(InvalidValueError, match=r"SLAM 'shunting\{"):
            parsed(wrong)


@pytest.mark.parametrize("name", ["shunting", "shunting-features", "occupancy"])
def test_create_sets_the_numbers_of_a_name(name: str) -> None:
    system = slam.create(name + "{cell_m=0.1,tracking.relocalise.most=3}")
    assert isinstance(system, Tracker)
    assert system.config.cell_m == 0.1
    assert system.config.tracking.relocalise.most == 3
    same = slam.create(name, config={"cell_m": 0.1, "tracking.relocalise.most": 3})
    assert isinstance(same, Tracker)
    assert same.config == system.config


def test_the_ekf_takes_numbers_on_top_of_the_preset_that_the_frames_ask_for() -> None:
    system = slam.create("ekf{separation_m=0.5}")
    system.update(tour()[0])
    assert system.config.confirm_looks == 8  # type: ignore[attr-defined]
    assert system.config.separation_m == 0.5  # type: ignore[attr-defined]


def test_what_cannot_be_set_is_said() -> None:
    with pytest.raises(UnknownNameError, match=r"Did you mean 'matching.reward'"):
        slam.create("shunting{matching.rewards=7}")
    with pytest.raises(InvalidValueError, match="'odometry' has no numbers to set"):
        slam.create("odometry{a=1}")
    with pytest.raises(InvalidValueError, match="numbers in its name and a config"):
        slam.create("shunting{reward=7}", config="paper")
    with pytest.raises(InvalidValueError, match=r"'map.bell_steps' is fixed at 512"):
        slam.create("shunting{map.bell_steps=256}")


def test_braces_may_name_a_preset() -> None:
    system = slam.create("shunting{cell_m=0.1,preset=paper}")
    assert system.config == ShuntingConfig.paper(cell_m=0.1)  # type: ignore[attr-defined]
    rival = slam.create("ekf{preset=corners,detection=0.7}")
    rival.update(tour()[0])
    assert rival.config == EkfConfig.corners(detection=0.7)  # type: ignore[attr-defined]
    found = slam.config_of("ekf{preset=victoria_park}")
    assert found is not None
    assert found[0] == EkfConfig.victoria_park()
    with pytest.raises(UnknownNameError, match="no preset 'papper'; it has robust, paper"):
        slam.create("shunting{preset=papper}")
    with pytest.raises(InvalidValueError, match="a preset as its config alone"):
        slam.create("shunting-features{preset=paper}")


def test_a_slam_of_ones_own_takes_numbers_too() -> None:
    system = slam.create(f"{__name__}:Own{{gain=0.7}}")
    assert system.config.gain == 0.7  # type: ignore[attr-defined]
    with pytest.raises(UnknownNameError, match=r"OwnConfig has no 'gian'. Did you mean 'gain'"):
        slam.create(f"{__name__}:Own{{gian=0.7}}")


def test_set_is_for_the_slam_it_names() -> None:
    assert with_set(["shunting", "odometry"], ["matching.reward=7"]) == (
        "shunting{matching.reward=7}", "odometry",
    )  # fmt: skip
    two = ["shunting", "ekf", "shunting{reward=3}"]
    assert with_set(two, ["shunting.cell_m=0.1", "ekf.detection=0.5"]) == (
        "shunting{cell_m=0.1}", "ekf{detection=0.5}", "shunting{cell_m=0.1,reward=3}",
    )  # fmt: skip
    assert with_set(two, []) == tuple(two)
    with pytest.raises(InvalidValueError, match="which SLAM"):
        with_set(two, ["reward=7"])
    with pytest.raises(InvalidValueError, match=r"'ekf' does not run.*Did you mean '--set x=1'"):
        with_set(["shunting"], ["ekf.x=1"])
    with pytest.raises(UnknownNameError, match=r"no 'detectoin'. Did you mean 'detection'"):
        with_set(["ekf"], ["ekf.detectoin=1"])
    with pytest.raises(InvalidValueError, match="expected PATH=VALUE"):
        with_set(["shunting"], ["reward"])
    with pytest.raises(InvalidValueError, match="set twice"):
        with_set(["shunting"], ["reward=7", "shunting.reward=8"])
