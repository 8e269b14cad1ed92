# SPDX-License-Identifier: Apache-2.0
"""3-D pictures, where the machine can make them, and one clear line where it cannot."""

import os
import subprocess
import sys
import warnings

import mujoco
import numpy as np
import pytest

import scenes
from sim.view import gl
from sim.view.camera import Camera, soften
from slam.errors import InvalidValueError, MissingDependencyError
from tests.built_scenes import placed

pytestmark = pytest.mark.film


@pytest.fixture(scope="module")
def world():
    return placed(scenes.build("arena", 0, n_chairs=4))


@pytest.fixture(scope="module")
def _needs_gl():
    found = gl.find()
    if found.backend is None:
        pytest.skip(f"3-D pictures are NOT tested: {found.reason}")


@pytest.mark.usefixtures("_needs_gl")
def test_each_camera_makes_a_picture_of_its_own_and_leaves_the_model_alone(world):
    model, data = world
    quality = model.vis.quality.shadowsize, model.vis.quality.numslices
    casting, colours = model.geom_castshadow.copy(), model.geom_rgba.copy()
    with warnings.catch_warnings(), Camera(model, 160, 90, samples=0) as camera:
        warnings.simplefilter("error")
        views = [camera.render(data, name) for name in ("top", "follow", "persp")]
        views += [camera.close_up(data, (0.0, 0.0)), camera.close_up(data, (2.0, 1.0))]
        kept = [view.copy() for view in views]
        model.geom_rgba[:, 3][model.geom_group == 3] = 1.0  # hulls are hidden
        np.testing.assert_array_equal(camera.render(data, "top"), views[0])
    model.geom_rgba[:] = colours
    for k, picture in enumerate(views):
        assert (picture.shape, picture.dtype) == ((90, 160, 3), np.uint8)
        assert picture.std() > 5.0
        assert all(np.abs(picture.astype(int) - other).mean() > 5.0 for other in views[:k])
    np.testing.assert_array_equal(views, kept)  # pictures share no memory
    assert (model.vis.quality.shadowsize, model.vis.quality.numslices) == quality
    np.testing.assert_array_equal(model.geom_castshadow, casting)


@pytest.mark.usefixtures("_needs_gl")
def test_shadows_darken_the_floor_and_are_the_only_difference(world):
    model, data = world
    pictures = []
    for shadows in (False, True):
        with Camera(model, 640, 360, shadows=shadows) as camera:
            pictures.append(camera.render(data, "top").astype(int).sum(axis=2))
    change = pictures[1] - pictures[0]
    assert 0.02 < (change < -60).mean() < 0.5
    assert (change > 60).mean() < 0.02


def test_only_edges_are_softened():
    picture = np.full((40, 40, 3), 100, np.uint8)
    picture[:, 20:] = 110  # no edge
    picture[20:] = 200
    soft = soften(picture.copy())
    np.testing.assert_array_equal(soft[:18], picture[:18])
    np.testing.assert_array_equal(soft[22:], picture[22:])
    assert (picture[19, 5] < soft[19, 5]).all()
    assert (soft[20, 5] < picture[20, 5]).all()


@pytest.mark.usefixtures("_needs_gl")
def test_a_camera_says_what_is_wrong(world):
    model, data = world
    camera = Camera(model, 32, 32, samples=0)
    with camera, pytest.raises(InvalidValueError, match="top"):
        camera.render(data, "nowhere")
    camera.close()
    with pytest.raises(InvalidValueError, match="closed"):
        camera.render(data, "top")
    with pytest.raises(InvalidValueError, match="closed"):
        camera.close_up(data, (0.0, 0.0))
    with Camera(model, 32, 32, samples=0) as camera:
        for field, value in (
            ("at", (np.nan, 0.0)), ("at", (1.0,)), ("at", "ab"), ("at", None), ("far_m", 0.0),
            ("far_m", "5"), ("azimuth_deg", np.nan), ("down_deg", np.inf),
        ):  # fmt: skip
            with pytest.raises(InvalidValueError, match=field):
                camera.close_up(data, **{"at": (0.0, 0.0), field: value})
    with pytest.raises(InvalidValueError, match="width"):
        Camera(model, 0, 32)


def test_without_gl_a_camera_gives_the_reason(world, monkeypatch):
    monkeypatch.setattr(gl, "find", lambda: gl.Gl(backend=None, reason="egl: no library"))
    with pytest.raises(MissingDependencyError, match="egl: no library"):
        Camera(world[0], 32, 32)


def test_find_asks_each_library_in_a_subprocess_and_joins_the_reasons(monkeypatch):
    asked = []

    def fail(program, backend):
        asked.append(backend)
        return "no library"

    monkeypatch.setattr(gl, "_try", fail)
    monkeypatch.setattr(gl, "_candidates", lambda: ("egl", "osmesa"))
    found = gl.find.__wrapped__()
    assert found.backend is None
    assert asked == ["egl", "osmesa"]
    assert "egl: no library; osmesa: no library" in found.reason


@pytest.mark.parametrize("value", ["nonsense", "cgl"])
def test_a_bad_mujoco_gl_does_not_kill_the_program(value):
    """In a fresh process: the import dies without the repair, and lives with it."""
    program = "{}import mujoco; print(note)"
    repair = "from sim.view import gl; note = gl.sanitise_environment(); "
    environment = {**os.environ, gl.VARIABLE: value}
    environment.pop("PYOPENGL_PLATFORM", None)
    plain, repaired = (
        subprocess.run(
            [sys.executable, "-c", program.format(start)],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        for start in ("note = ''; ", repair)
    )
    assert plain.returncode != 0
    assert repaired.returncode == 0, repaired.stderr
    assert f"{gl.VARIABLE}={value} is ignored" in repaired.stdout
    assert len(repaired.stdout.splitlines()) == 1


CROWDED = """
<mujoco>
  <worldbody>
    <light pos="0 0 5" dir="0 0 -1"/>
    <body name="robot">
      <geom type="box" size="0.3 0.3 0.2" pos="0 0 0.2" rgba="1 0 0 1" mass="1"/>
      <camera name="follow" pos="-1.9 0 2.3" xyaxes="0 -1 0 0.63 0 0.777" fovy="55"/>
    </body>
    <body name="person" pos="-1 0 0">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 1 0"/>
      <geom type="capsule" size="0.2" fromto="0 0 0.9 0 0 1.6" group="2" rgba="0 1 0 1" mass="1"/>
    </body>
    <body name="leg" mocap="true" pos="-1 0.1 0">
      <geom type="capsule" size="0.1" fromto="0 0 0 0 0 0.8" group="2" rgba="0 1 0 1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.usefixtures("_needs_gl")
def test_nobody_hides_the_robot_from_the_camera_that_follows_it():
    model = mujoco.MjModel.from_xml_string(CROWDED)
    data = mujoco.MjData(model)
    colours = model.geom_rgba.copy()

    def seen(dx: float, dy: float) -> tuple[float, float]:
        """The share of the robot's red in the picture, and the brightest of a person's green."""
        data.qpos[:] = dx, dy
        data.mocap_pos[0] = -1.0 + dx, dy + 0.1, 0.0
        mujoco.mj_forward(model, data)
        with Camera(model, 160, 90, shadows=False) as camera:
            picture = camera.render(data, "follow").astype(int)
        red = (picture[..., 0] > picture[..., 1] + 25) & (picture[..., 0] > 60)
        green = picture[..., 1][picture[..., 1] > 4 * picture[..., 0]]
        return float(red.mean()), int(green.max(initial=0))

    alone, _ = seen(20.0, 0.0)
    assert alone > 0.01
    _, solid = seen(0.5, 1.2)  # who is not in the way stays as he is
    assert solid > 60
    for dx in (0.0, -0.4, -0.9, 0.4):  # half way, at the camera, beside the robot
        red, glass = seen(dx, 0.0)
        assert red > 0.9 * alone
        assert glass < 0.6 * solid
    np.testing.assert_array_equal(model.geom_rgba, colours)
