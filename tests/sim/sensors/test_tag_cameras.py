# SPDX-License-Identifier: Apache-2.0
"""The stand-in for ceiling cameras: rate, latency, noise, and who stands in the way."""

from __future__ import annotations

import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from sim.sensors.tag_cameras import TagCameraConfig, TagCameras
from slam.errors import InvalidValueError

BOUNDS = (-1.0, -1.0, 1.0, 1.0)  # one camera, above the origin
STEP_NS = 1_000_000_000 // 300


def watch(
    tags: TagCameras, model: mujoco.MjModel, data: mujoco.MjData, steps: int, speed: float = 0.0
) -> list[np.ndarray]:
    """(3,) of each picture's first tag."""
    seen, last = [], None
    for k in range(steps):
        data.qpos[0] = speed * k / 300.0
        mujoco.mj_kinematics(model, data)
        now = k * STEP_NS
        tags.note(now, data)
        reading = tags.latest(now + 10**9)
        if reading is not None and reading is not last:
            seen.append(reading.poses[0])
            last = reading
    return seen


def test_thirty_pictures_a_second_and_readings_come_late(room: SimpleNamespace) -> None:
    model, data = room.build()
    tags = TagCameras(model, BOUNDS, TagCameraConfig(latency_s=0.05))
    assert len(watch(tags, model, data, 300)) == 30
    newest = tags.latest(10**10)
    assert newest is not None
    assert tags.latest(newest.arrival_ns - 1) is not newest
    assert tags.latest(newest.arrival_ns) is newest
    assert newest.arrival_ns - newest.stamp_ns == 50_000_000
    assert tags.latest(0) is None


def test_noise_and_constant_error_are_as_set(room: SimpleNamespace) -> None:
    model, data = room.build()
    config = TagCameraConfig(rate_hz=300.0, noise_std_m=0.01, bias_std_m=0.0)
    poses = np.array(watch(TagCameras(model, BOUNDS, config), model, data, 2000))
    assert poses[:, :2].std() == pytest.approx(0.01, rel=0.06)
    assert poses[:, 2].std() == pytest.approx(config.noise_std_rad, rel=0.06)
    assert np.abs(poses.mean(axis=0)).max() < 0.001
    still = TagCameraConfig(noise_std_m=0.0, bias_std_m=0.02)
    means = [
        watch(TagCameras(model, BOUNDS, still, np.random.default_rng(s)), model, data, 20)[0][0]
        for s in range(200)
    ]
    assert np.std(means) == pytest.approx(0.02, rel=0.15)


def test_who_stands_between_tag_and_camera_hides_it(room: SimpleNamespace) -> None:
    """The camera is above the origin; a person of 1.75 m at x = 0.5 hides a robot at x = 0.9."""
    person = '<geom type="cylinder" size=".2 .875" pos=".5 0 .875"/>'
    ghost = person.replace("/>", ' group="3"/>')
    for world, hidden in ((person, True), (ghost, False), ("", False)):
        model, data = room.build(world)
        data.qpos[0] = 0.9
        mujoco.mj_kinematics(model, data)
        tags = TagCameras(model, BOUNDS, TagCameraConfig(noise_std_m=0.0, bias_std_m=0.0))
        tags.note(0, data)
        reading = tags.latest(10**9)
        assert reading is not None
        assert np.isnan(reading.poses[0]).all() == hidden
        assert (reading.camera[0] < 0) == hidden
        if not hidden:
            assert reading.poses[0, 0] == pytest.approx(0.9)


def test_a_second_camera_sees_past_and_far_away_there_is_none(room: SimpleNamespace) -> None:
    person = '<geom type="cylinder" size=".2 .875" pos=".5 0 .875"/>'
    model, data = room.build(person)
    data.qpos[0] = 0.9
    mujoco.mj_kinematics(model, data)
    tags = TagCameras(model, (-1.0, -1.0, 5.0, 1.0))
    assert len(tags.cameras) == 2
    tags.note(0, data)
    reading = tags.latest(10**9)
    assert reading is not None
    assert tags.cameras[reading.camera[0], 0] > 0.9
    data.qpos[0] = 9.0
    mujoco.mj_kinematics(model, data)
    tags.note(10**9, data)
    away = tags.latest(10**10)
    assert away is not None
    assert away.camera[0] == -1


def test_draws_do_not_depend_on_what_is_seen(room: SimpleNamespace) -> None:
    states = []
    for x in (0.0, 50.0):
        model, data = room.build()
        data.qpos[0] = x
        mujoco.mj_kinematics(model, data)
        rng = np.random.default_rng(3)
        tags = TagCameras(model, BOUNDS, rng=rng)
        for k in range(5):
            tags.note(k * 10**8, data)
        states.append(rng.bit_generator.state)
    assert states[0] == states[1]


def test_impossible_cameras_are_refused(room: SimpleNamespace) -> None:
    for name, value in (("rate_hz", 0.0), ("noise_std_m", -1.0), ("latency_s", math.nan)):
        with pytest.raises(InvalidValueError, match=rf"TagCameraConfig\.{name}"):
            TagCameraConfig(**{name: value})
    with pytest.raises(InvalidValueError, match="above tag_height_m"):
        TagCameraConfig(height_m=0.3)
    with pytest.raises(InvalidValueError, match="no body 'chair9/base'"):
        TagCameras(room.build()[0], BOUNDS, bodies=["chair9/base"])
