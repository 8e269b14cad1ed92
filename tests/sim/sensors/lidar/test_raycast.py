# SPDX-License-Identifier: Apache-2.0
"""The caster against MuJoCo's own rays, and what it must refuse."""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from sim.sensors.lidar.caster import FanPlan, Raycaster
from sim.sensors.lidar.scanner import Spot
from slam import se2
from slam.errors import InvalidValueError

HEIGHT = 0.36
GROUPS = np.array([1, 1, 1, 0, 1, 0], dtype=np.uint8)  # neither hulls nor painted shadows
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
    """Primitives of all kinds and attitudes, some upright, some unseen (hulls, paint, clear)."""
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
            group=int(rng.choice([0, 1, 3, 4, 5], p=[0.6, 0.1, 0.1, 0.1, 0.1])),
            rgba=[1, 1, 1, 0 if rng.random() < 0.1 else 1],
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def plan(angles: NDArray[np.float64], taus: NDArray[np.float64] | None = None) -> FanPlan:
    """One fan within one physics step."""
    n = angles.size
    parts = np.linspace(0.0, 1.0, n) if taus is None else taus
    return FanPlan.of([(np.arange(n), angles, np.zeros(n), parts)])


def cast(
    caster: Raycaster, angles: NDArray[np.float64], start: tuple, end: tuple | None = None
) -> Hits:
    """One fan: (ranges, geom ids, cosines), each (beams, rays)."""
    caster.note()
    caster.lasers[0], caster.lasers[1] = start, start if end is None else end
    caster.cast(plan(angles))
    ids = np.append(caster.ids, -1)
    return caster.hits[0][0], ids[caster.hits[1][0]], caster.hits[2][0]


def multi_ray(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: NDArray[np.float64],
    vectors: NDArray[np.float64],
) -> Hits:
    """MuJoCo's answer: (ranges, geom ids, |cos| of the incidence)."""
    n = len(vectors)
    ranges, geoms, normals = np.zeros(n), np.zeros(n, dtype=np.int32), np.zeros(3 * n)
    mujoco.mj_multiRay(
        model, data, origin, vectors.ravel(), GROUPS, True, -1, geoms, ranges, normals, n, 1e10
    )  # fmt: skip
    cosines = np.abs((normals.reshape(n, 3) * vectors).sum(axis=1))
    return np.where(geoms < 0, np.inf, ranges), geoms.astype(np.int64), cosines


def level(azimuth: float) -> NDArray[np.float64]:
    """(1, 3) direction of one level ray."""
    return np.array([[math.cos(azimuth), math.sin(azimuth), 0.0]])


def directions(caster: Raycaster) -> NDArray[np.float64]:
    """(beams, 3) of the level beams just cast, to the last bit; checked against the azimuth."""
    azimuths, cos, sin = caster.fan[:, 0], caster.fan[:, 3], caster.fan[:, 4]
    np.testing.assert_allclose(cos, np.cos(azimuths), atol=4e-16 * 4)
    np.testing.assert_allclose(sin, np.sin(azimuths), atol=4e-16 * 4)
    return np.column_stack((cos, sin, np.zeros(cos.size)))


def fuzz(rays: int, seed: int) -> tuple[int, int, float]:
    """(rays cast, rays that differ from ``mj_multiRay`` in range bits or geom, worst cosine).

    ``python -c "from tests.sim.sensors.lidar.test_raycast import fuzz; print(fuzz(600_000, 1))"``
    is the long version.
    """
    rng = np.random.default_rng(seed)
    done, different, worst = 0, 0, 0.0
    angles = np.linspace(-math.pi / 2, math.pi / 2, 361)
    while done < rays:
        model, data = random_world(rng)
        caster = Raycaster(model, height=HEIGHT, robot=None)
        for _ in range(10):
            caster.start(data)
            x, y, yaw = (*rng.uniform(-8, 8, 2).tolist(), float(rng.uniform(-3.1, 3.1)))
            ranges, geoms, cosines = (a[:, 0] for a in cast(caster, angles, (x, y, yaw)))
            want = multi_ray(model, data, np.array([x, y, HEIGHT]), directions(caster))
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


def test_a_whole_turn_of_two_fans_while_robot_and_things_move() -> None:
    """Two sweeps, three notes each; every beam against MuJoCo with things where they are then."""
    rng = np.random.default_rng(8)
    model, data = random_world(rng)
    still = mujoco.MjData(model)
    caster = Raycaster(model, height=HEIGHT, robot=None)
    moves = rng.normal(size=data.qpos.shape) * 0.01
    for k in range(3, moves.size, 7):  # keep the attitudes: only the way is straight exactly
        moves[k : k + 4] = 0.0
    first = data.qpos.copy()
    notes = (0, 1, 2, 4, 5, 6)  # physics steps
    pose, step = np.array([0.2, -0.1, 3.0]), np.array([0.004, 0.002, 0.1])
    for slot, k in enumerate(notes):
        data.qpos[:] = first + k * moves
        mujoco.mj_kinematics(model, data)
        caster.start(data) if slot == 0 else caster.note()
        x, y, yaw = (pose + k * step).tolist()
        caster.lasers[slot] = x, y, se2.wrap(yaw)  # through the cut at pi
    angles = np.linspace(-math.pi / 2, math.pi / 2, 91)
    times = np.linspace(0.0, 2.0, 91)
    slots = np.minimum(np.floor(times), 1.0)
    caster.cast(
        FanPlan.of(
            [(2 * np.arange(91) + f, angles, slots + 3 * f, times - slots) for f in range(2)]
        )
    )
    ids = np.append(caster.ids, -1)
    for f in range(2):
        for i, time in enumerate((times + 4.0 * f).tolist()):
            still.qpos[:] = first + time * moves
            mujoco.mj_forward(model, still)
            x, y, yaw = (pose + time * step).tolist()
            origin, way = np.array([x, y, HEIGHT]), level(yaw + angles[i])
            want = multi_ray(model, still, origin, way)
            beam = 2 * i + f
            assert caster.hits[0][0, beam, 0] == pytest.approx(want[0][0], abs=1e-6)
            assert ids[caster.hits[1][0, beam, 0]] == want[1][0]


def test_what_rests_begins_to_move_or_is_put_elsewhere_as_a_new_caster_sees_it() -> None:
    """Poses and bounds of what has not moved are kept from scan to scan."""
    rng = np.random.default_rng(12)
    model, data = random_world(rng)
    used = Raycaster(model, height=HEIGHT, robot=None)
    angles = np.linspace(-math.pi, math.pi, 361)
    slots = np.repeat(np.arange(3), 121)[:361]
    ways = [FanPlan.of([(np.arange(361), angles, slots, rng.random(361))]) for _ in range(2)]
    for scan in range(12):
        new = Raycaster(model, height=HEIGHT, robot=None)
        for slot in range(4):
            if slot or scan % 3 == 0:  # between two scans, or between two notes of one
                rows = 7 * np.flatnonzero(rng.random(model.nbody - 1) < 0.1)
                data.qpos[rows] += rng.uniform(-0.3, 0.3, rows.size)
            mujoco.mj_kinematics(model, data)
            for caster in (used, new):
                caster.note() if slot else caster.start(data)
                caster.lasers[slot] = (0.1, 0.2, 0.01 * slot)
        for caster in (used, new):
            caster.cast(ways[scan % 2])
        for a, b in zip(used.hits, new.hits, strict=True):
            assert a.tobytes() == b.tobytes()


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


def test_an_unknown_robot_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(InvalidValueError, match="no body 'robot/base'"):
        Raycaster(model, height=HEIGHT)


@pytest.mark.parametrize("far", [1e19, -1e19, 3e38, 1e300, math.inf, -math.inf, math.nan])
def test_what_is_nowhere_is_not_met_and_harms_nothing(far: float) -> None:
    """No place of a geom is one of the caster's tables: 1e19 m wrote beside them, once."""
    spec = mujoco.MjSpec()
    for x in (3.0, -3.0):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.5, 1], pos=[x, 0, 0.4])
    for kind in SHAPES:
        body = spec.worldbody.add_body()
        body.add_freejoint()
        body.add_geom(type=kind, size=[0.3, 0.3, 0.3])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    angles = np.linspace(-0.1, 0.1, 5)
    for axis in range(3):
        mujoco.mj_forward(model, data)
        data.geom_xpos[2:, axis] = far
        caster = Raycaster(model, height=HEIGHT, robot=None)
        caster.start(data)
        ranges, geoms, _ = cast(caster, angles, (0.0, 0.0, 0.0))
        np.testing.assert_allclose(ranges[:, 0], 2.9 / np.cos(angles))
        assert (geoms == 0).all()
        cast(caster, angles, (far, 0.0, 0.0))  # by a laser that is nowhere, too
