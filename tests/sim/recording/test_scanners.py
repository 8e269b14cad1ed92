# SPDX-License-Identifier: Apache-2.0
"""Recordings of every scanner are what was seen live: bags, CARMEN logs, recipes, episodes."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.moments import toured
from sim.recording.bag import BagWriter
from sim.recording.dataset import Plan, read_plan
from sim.recording.recipe import RECIPE, Recipe, read_recipe, write_recipe
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation
from sim.twins.twins import Twins
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.logs import read_bag

pytestmark = pytest.mark.slow
NAMES = ("utm30lx", "tim561", "rplidar_a1", "scanner(fov_deg=360,beams=500,rate_hz=33,sigma_m=0)")


@pytest.mark.parametrize("name", NAMES)
def test_a_bag_gives_the_frames_back(tmp_path: Path, name: str) -> None:
    simulation = Simulation("arena", seed=1, laser=name, labels=True)
    moments = list(toured(simulation, 0.6))
    with BagWriter(tmp_path / "bag", simulation.spec) as bag:
        for moment in moments:
            bag.write(moment)
    frames = list(read_bag(tmp_path / "bag", labels=True))
    assert len(frames) == len(moments)
    for moment, frame in zip(moments, frames, strict=True):
        wanted = moment.frame
        assert wanted.scan is not None
        assert frame.scan is not None
        ours, theirs = frame.scan.spec, wanted.scan.spec
        assert frame.stamp_ns == wanted.stamp_ns
        np.testing.assert_array_equal(frame.scan.ranges, wanted.scan.ranges)
        np.testing.assert_allclose(ours.angles, theirs.angles, atol=1e-6)
        np.testing.assert_allclose(ours.beam_time_offsets, theirs.beam_time_offsets, atol=2e-8)
        assert frame.labels is not None
        assert wanted.labels is not None
        np.testing.assert_array_equal(frame.labels.kind, wanted.labels.kind)
        np.testing.assert_array_equal(frame.labels.body, wanted.labels.body)


def test_a_recipe_takes_registered_names_only(tmp_path: Path) -> None:
    recipe = Recipe(scene="arena", seed=2, dynamism=1.0, seconds=0.5)
    assert recipe.laser() == Lms221Config()
    assert replace(recipe, resolution_deg=1.0, scanner="noise").laser() == (
        Lms221Config.noise_only(resolution_deg=1.0)
    )
    with pytest.raises(UnknownNameError, match="no scanner is called 'os'"):
        replace(recipe, scanner="os:system")
    with pytest.raises(InvalidValueError, match="no setting 'resolution_deg'"):
        replace(recipe, scanner="tim561", resolution_deg=1.0)
    write_recipe(tmp_path / RECIPE, recipe, {})
    text = (tmp_path / RECIPE).read_text().replace('"scanner": "full"', '"scanner": "my:Laser"')
    (tmp_path / RECIPE).write_text(text)
    with pytest.raises(LogFormatError, match="no scanner is called 'my:Laser'"):
        read_recipe(tmp_path / RECIPE)


def test_twins_of_a_scanner_between_the_steps_have_one_path_odometry_and_timing() -> None:
    made = Twins("arena", seconds=1.0, seed=3, dynamism=0.5, laser="utm30lx:ideal", crowd="none")
    moving, moved, still = (
        [moment.frame for moment in made.moments(name)]
        for name in ("dynamic", "semi_static", "static")
    )
    assert len(moving) == len(moved) == len(still) == 40
    for frames in zip(moving, moved, still, strict=True):
        assert len({frame.stamp_ns for frame in frames}) == 1
        for frame in frames[1:]:
            assert frame.odometry == frames[0].odometry
            np.testing.assert_array_equal(frame.truth, frames[0].truth)
    # What stands still is the same for all: most beams of the first scan agree.
    assert moving[0].scan is not None
    assert still[0].scan is not None
    agree = moving[0].scan.ranges == still[0].scan.ranges
    assert math.isclose(float(agree.mean()), 1.0, abs_tol=0.2)


def test_a_dataset_of_an_unknown_scanner_is_refused_by_its_file(tmp_path):
    recipe = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1, scanner="ideal")
    text = Plan(recipe=recipe, dynamisms=(0.5,), episodes=2).text()
    (tmp_path / "dataset.json").write_text(text.replace('"ideal"', '"eyes"'))
    with pytest.raises(LogFormatError, match=r"dataset\.json: .*no scanner is called 'eyes'"):
        read_plan(tmp_path)
