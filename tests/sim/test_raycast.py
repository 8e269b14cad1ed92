# SPDX-License-Identifier: Apache-2.0
"""The caster against MuJoCo's own rays, and what it must refuse."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from sim.caster import Raycaster, Spot
from slam.errors import InvalidValueError

HEIGHT = 0.36
GROUPS = np.array([1, 1, 1, 0, 1, 1], dtype=np.uint8)
SHAPES = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX,
)
Hits = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]


def random_world(
    rng: np.random.Generator, bodies: int = 60
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Primitives of all kinds and attitudes, some upright, some in the hull group, some clear."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 0.1])
    for i in range(bodies):
        upright = rng.random() < 0.5
        quat = [math.cos(i), 0.0, 0.0, math.sin(i)] if upright else rng.normal(size=4)
        body = spec.worldbody.add_body(pos=[*rng.uniform(-8, 8, 2), rng.uniform(0.0, 0.7)])
        body.add_freejoint()
        body.add_geom(
            type=SHAPES[rng.integers(len(SHAPES))],
            size=rng.uniform(0.03, 0.6, 3),
            quat=quat / np.linalg.norm(quat),
            group=3 if rng.random() < 0.1 else 0,
            rgba=[1, 1, 1, 0 if rng.random() < 0.1 else 1],
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def misses(beams: int, rays: int = 1) -> Hits:
    shape = (beams, rays)
    return np.full(shape, np.inf), np.full(shape, -1, dtype=np.int64), np.full(shape, np.nan)


def cast(
    caster: Raycaster, angles: NDArray[np.float64], start: tuple, end: tuple | None = None
) -> Hits:
    """One fan: (ranges, geom ids, cosines), each (beams,)."""
    out = misses(angles.size, caster.rays_per_beam)
    taus = np.linspace(0.0, 1.0, angles.size)
    caster.cast((np.arange(angles.size), angles, taus), (start, start if end is None else end), out)
    ids = np.append(caster.ids, -1)
    return out[0], ids[out[1]], out[2]


def multi_ray(
    model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64], azimuths: list[float]
) -> Hits:
    """MuJoCo's answer for level rays: (ranges, geom ids, |cos| of the incidence)."""
    n = len(azimuths)
    vectors = np.array([[math.cos(a), math.sin(a), 0.0] for a in azimuths])
    ranges, geoms, normals = np.zeros(n), np.zeros(n, dtype=np.int32), np.zeros(3 * n)
    mujoco.mj_multiRay(
        model, data, origin, vectors.ravel(), GROUPS, True, -1, geoms, ranges, normals, n, 1e10
    )  # fmt: skip
    cosines = np.abs((normals.reshape(n, 3) * vectors).sum(axis=1))
    return np.where(geoms < 0, np.inf, ranges), geoms.astype(np.int64), cosines


def fuzz(rays: int, seed: int) -> tuple[int, int, float]:
    """(rays cast, rays that differ from ``mj_multiRay`` in range bits or geom, worst cosine).

    ``python -c "from tests.sim.test_raycast import fuzz; print(fuzz(600_000, 1))"`` is the long
    version.
    """
    rng = np.random.default_rng(seed)
    done, different, worst = 0, 0, 0.0
    angles = np.linspace(-math.pi / 2, math.pi / 2, 361)
    while done < rays:
        model, data = random_world(rng)
        caster = Raycaster(model, height=HEIGHT, robot=None)
        caster.start(data)
        for _ in range(10):
            x, y, yaw = (*rng.uniform(-8, 8, 2).tolist(), float(rng.uniform(-3.1, 3.1)))
            ranges, geoms, cosines = (a[:, 0] for a in cast(caster, angles, (x, y, yaw)))
            azimuths = [yaw + 0.0 + a for a in angles.tolist()]
            want = multi_ray(model, data, np.array([x, y, HEIGHT]), azimuths)
            different += int(((ranges != want[0]) | (geoms != want[1])).sum())
            hit = geoms >= 0
            worst = max(worst, float(np.abs(cosines - want[2])[hit].max(initial=0.0)))
            done += angles.size
    return done, different, worst


def test_ranges_and_geoms_are_those_of_mj_multiray_to_the_last_bit() -> None:
    rays, different, worst_cosine = fuzz(25_000, seed=5)
    assert rays >= 25_000
    assert different == 0
    assert worst_cosine < 1e-9


def test_each_beam_starts_where_the_laser_is_at_its_time() -> None:
    rng = np.random.default_rng(2)
    model, data = random_world(rng)
    caster = Raycaster(model, height=HEIGHT, robot=None)
    caster.start(data)
    angles = np.linspace(-math.pi / 2, 0.0, 91)
    start, end = (0.3, -0.2, 3.1), (0.37, -0.1, -3.1)  # through the cut at pi
    ranges, geoms, _ = cast(caster, angles, start, end)
    turn = math.tau - 6.2
    for i, tau in enumerate(np.linspace(0.0, 1.0, 91).tolist()):
        origin = np.array([0.3 + tau * 0.07, -0.2 + tau * 0.1, HEIGHT])
        azimuth = 3.1 + tau * turn + angles[i]
        want = multi_ray(model, data, origin, [azimuth])
        assert ranges[i, 0] == pytest.approx(want[0][0], abs=1e-9)
        assert geoms[i, 0] == want[1][0]


def test_moving_things_are_seen_where_they_are_at_the_time_of_the_beam() -> None:
    rng = np.random.default_rng(3)
    model, data = random_world(rng)
    still = mujoco.MjData(model)
    caster = Raycaster(model, height=HEIGHT, robot=None)
    caster.start(data)
    speed = rng.normal(size=data.qpos.shape) * 0.01  # 3 m/s over 1/300 s
    before = data.qpos.copy()
    after = before + speed
    for k in range(3, after.size, 7):  # keep the attitudes: only the way is straight exactly
        after[k : k + 4] = before[k : k + 4]
    data.qpos[:] = after
    mujoco.mj_kinematics(model, data)
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    ranges, geoms, _ = cast(caster, angles, (0.1, 0.2, 1.0))
    for i, tau in enumerate(np.linspace(0.0, 1.0, 181).tolist()):
        still.qpos[:] = before + tau * (after - before)
        mujoco.mj_forward(model, still)
        want = multi_ray(model, still, np.array([0.1, 0.2, HEIGHT]), [1.0 + angles[i]])
        assert ranges[i, 0] == pytest.approx(want[0][0], abs=1e-6)
        assert geoms[i, 0] == want[1][0]


def test_the_end_of_a_step_is_the_start_of_the_next() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body mocap="true" pos="3 0 .36"><geom size=".5"/></body>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    caster = Raycaster(model, height=HEIGHT, robot=None)
    caster.start(data)
    ahead = np.zeros(1)
    seen = []
    for x in (3.0, 3.1, 3.1, 3.1, 3.3):
        data.mocap_pos[0, 0] = x
        mujoco.mj_kinematics(model, data)
        out = misses(1)
        caster.cast((np.arange(1), ahead, np.array([0.5])), ((0.0, 0.0, 0.0),) * 2, out)
        seen.append(float(out[0][0, 0]))
    assert seen == pytest.approx([2.5, 2.55, 2.6, 2.6, 2.7], abs=1e-12)


def test_the_rays_of_a_spot_go_where_its_disc_says() -> None:
    rng = np.random.default_rng(4)
    model, data = random_world(rng)
    offsets = ((0.0, 0.0), (0.9, 0.0), (-0.3, 0.8), (-0.3, -0.8))
    spot = Spot(aperture=0.008, divergence=0.00595, offsets=offsets)
    caster = Raycaster(model, height=HEIGHT, robot=None, spot=spot)
    caster.start(data)
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    ranges, geoms, _ = cast(caster, angles, (0.5, 0.5, 0.4))
    for i, angle in enumerate(angles.tolist()):
        c, s = math.cos(0.4 + angle), math.sin(0.4 + angle)
        for k, (u, v) in enumerate(offsets):
            left, up = 0.008 * u, 0.008 * v
            origin = np.array([0.5 - s * left, 0.5 + c * left, HEIGHT + up])
            a, b = 0.00595 * u, 0.00595 * v
            vec = np.array([c - s * a, s + c * a, b]) / math.sqrt(1.0 + a * a + b * b)
            geom = np.zeros(1, dtype=np.int32)
            want = mujoco.mj_ray(model, data, origin, vec, GROUPS, True, -1, geom)
            assert geoms[i, k] == geom[0]
            assert ranges[i, k] == pytest.approx(want if want >= 0.0 else math.inf, abs=1e-9)


def test_a_scanner_does_not_see_its_own_robot(room) -> None:
    model, data = room.build()
    caster = Raycaster(model, height=HEIGHT)
    caster.start(data)
    ranges, _, _ = cast(caster, np.zeros(1), (0.0, 0.0, 0.0))
    assert ranges[0, 0] == pytest.approx(4.0)


def test_a_mesh_at_scan_height_is_refused_by_name() -> None:
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="blob")
    mesh.uservert = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]
    spec.worldbody.add_geom(
        name="vase", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="blob", pos=[2, 0, 0.2]
    )
    with pytest.raises(InvalidValueError, match="'vase' is a mesh at the height of the scanner"):
        Raycaster(spec.compile(), height=HEIGHT, robot=None)
    spec.geom("vase").pos = [2, 0, 3]
    assert Raycaster(spec.compile(), height=HEIGHT, robot=None).ids.size == 0


def test_an_unknown_robot_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(InvalidValueError, match="no body 'robot/base'"):
        Raycaster(model, height=HEIGHT)
