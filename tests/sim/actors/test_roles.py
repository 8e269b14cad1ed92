# SPDX-License-Identifier: Apache-2.0
"""Crowds do what ``scenes.crowd`` says of each kind."""

import math

import numpy as np
import pytest

from sim.actors.config import ACTORS
from sim.core.dynamism import Dynamism
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, tour
from sim.world.world import SUBSTEPS_PER_S, World
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
CALM = Dynamism(stay_mean=4.0)  # people walk, nothing is shoved
STEP = 30  # substeps from one sample to the next: 0.1 s


def _world(crowd: str, scene: str = "arena", seed: int = 1, **options: int) -> World:
    if scene == "arena":
        options = {"n_chairs": 0, **options}
    return World(scene, seed=seed, dynamism=CALM, crowd=crowd, **options)


def _poses(world: World, kin: str) -> np.ndarray:
    """(n, 3) of the movers called so."""
    rows = [i for i, name in enumerate(world.mover_names) if name.rstrip("0123456789") == kin]
    return world.mover_poses()[rows]


def _watch(world: World, seconds: float, *kins: str) -> list[np.ndarray]:
    """(steps, n, 3) of the movers called so, ten a second."""
    seen: list[list[np.ndarray]] = [[] for _ in kins]
    for _ in range(round(10 * seconds)):
        for _ in range(STEP):
            world.substep()
        for samples, kin in zip(seen, kins, strict=True):
            samples.append(_poses(world, kin))
    return [np.array(samples) for samples in seen]


def test_escorts_stay_with_the_robot_and_stop_with_it():
    world = _world("escorts:6")
    pilot, far = Pilot(world), []
    for _ in range(250):
        world.set_command(*pilot.command(0.1))
        (seen,) = _watch(world, 0.1, "escort")
        far.append(np.linalg.norm(seen[0, :, :2] - world.robot_pose()[:2], axis=1))
    assert np.mean(np.array(far[50:]) < 3.0) > 0.8
    world.set_command(0.0, 0.0)
    _watch(world, 7.0)
    (seen,) = _watch(world, 2.0, "escort")
    assert np.linalg.norm(seen[-1, :, :2] - seen[0, :, :2], axis=1).max() < 0.3
    assert not any(contact.kind == "person" for contact in world.take_contacts())


def test_escorts_begin_around_the_robot_wherever_it_starts():
    usual = _world("escorts:6,streams:2")
    x, y, yaw = usual.scene.start
    start = (-x, -y, yaw + 2.0)
    world = World("arena", seed=1, dynamism=CALM, n_chairs=0, crowd="escorts:6", start=start)
    np.testing.assert_allclose(world.robot_pose(), start)
    for each in (usual, world):
        far = np.linalg.norm(_poses(each, "escort")[:, :2] - each.robot_pose()[:2], axis=1)
        assert far.min() > 0.5
        assert far.max() < 3.0
    for wrong in ((math.nan, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 1.0)):
        with pytest.raises(InvalidValueError, match="start"):
            World("arena", seed=1, dynamism=CALM, crowd="escorts:2", start=wrong)


def test_streams_go_from_end_to_end():
    (seen,) = _watch(_world("streams:4", "corridor", n_people=0), 40.0, "stream")
    assert np.ptp(seen[:, :, 0], axis=0).min() > 15.0


def test_a_queue_moves_up():
    world = _world("queue:4")
    before = _poses(world, "queue")[:, :2]
    _watch(world, ACTORS.following.served_s + 4.0)
    after = _poses(world, "queue")[:, :2]
    np.testing.assert_allclose(after[1:], before[:-1], atol=0.3)


def test_a_group_stops_together():
    world = _world("groups:4")
    (seen,) = _watch(world, 40.0, "group")
    steps = 10.0 * np.linalg.norm(np.diff(seen[:, :, :2], axis=0), axis=2)
    stands = np.array([(steps[k - 20 : k, 0] < 0.05).all() for k in range(20, len(steps))])
    assert stands.any()
    assert steps[:, 0].max() > 0.5
    assert np.median(steps[20:, 1:][stands]) < 0.1
    apart = np.linalg.norm(seen[:, 1:, :2] - seen[:, :1, :2], axis=2)
    assert np.quantile(apart, 0.9) < 4.5


def test_a_board_stays_in_the_hands_that_hold_it():
    world = _world("boards:1")
    hold = world.scene.holds[0]
    at, dof = world.bodies.addresses([hold.holder, hold.held])
    off, turned, pushed = [], [], []
    for _ in range(250):
        _watch(world, 0.1)
        holder, held = world.data.qpos[at[0] : at[0] + 3], world.data.qpos[at[1] : at[1] + 3]
        c, s = math.cos(holder[2]), math.sin(holder[2])
        off.append(
            math.hypot(
                holder[0] + c * hold.pose[0] - held[0], holder[1] + s * hold.pose[0] - held[1]
            )
        )
        turned.append(abs(math.remainder(held[2] - holder[2] - hold.pose[2], 2.0 * math.pi)))
        forces = world.data.qfrc_applied
        push, back = forces[dof[1] : dof[1] + 2], forces[dof[0] : dof[0] + 2]
        np.testing.assert_allclose(push, -back, atol=1e-9)
        pushed.append(math.hypot(*push))
    assert np.quantile(off, 0.95) < 0.15
    assert np.quantile(turned, 0.95) < math.radians(10.0)
    assert 0.0 < max(pushed) <= ACTORS.holding.force_max + 1e-9


@pytest.mark.parametrize("seed", [1, 2])
def test_a_couch_is_between_its_carriers(seed):
    world = _world("couches:1", seed=seed)
    carriers, couch = _watch(world, 30.0, "carrier", "couch")
    assert np.ptp(couch[:, 0, :2], axis=0).max() > 1.0
    apart = np.linalg.norm(carriers[:, :, :2] - couch[:, :, :2], axis=2)
    assert np.abs(apart - apart[0]).max() < 0.35
    ends = carriers[:, :, :2] - couch[:, :, :2]
    along = np.stack([np.cos(couch[:, 0, 2]), np.sin(couch[:, 0, 2])], axis=1)
    off = np.abs(np.einsum("tka,ta->tk", ends, along)) / apart
    assert off.min() > math.cos(math.radians(35.0))


def test_wagons_follow_who_pulls_them():
    puller, wagons = _watch(_world("trains:1", "warehouse"), 30.0, "train_puller", "wagon")
    train = np.concatenate([puller, wagons], axis=1)[:, :, :2]
    first = np.linalg.norm(train[:, 0] - train[:, 1], axis=1)
    second = np.linalg.norm(train[:, 1] - train[:, 2], axis=1)
    assert np.ptp(puller[:, 0, :2], axis=0).max() > 3.0
    assert np.abs(first - first[0]).max() < 0.4
    assert np.abs(second - second[0]).max() < 0.4


def test_a_cleaner_fills_a_row_of_chairs_and_empties_it():
    world = _world("cleaners:1", n_chairs=3)
    places = np.array(world.scene.roles["cleaner0"].places)
    before = _poses(world, "chair")[:, :2]
    full, chairs = 0, before
    for _ in range(90):
        (seen,) = _watch(world, 1.0, "chair")
        chairs = seen[-1, :, :2]
        gaps = np.linalg.norm(chairs[:, None] - places[None], axis=2)
        full = max(full, int((gaps.min(axis=0) < 0.25).sum()))
        lines = world.people.table.leaders.lines
        if full >= 2 and (lines["chair"] < 0.0).all():
            break
    assert full >= 2
    assert np.linalg.norm(chairs - before, axis=1).min() < 0.5


@pytest.fixture(scope="module")
def mixed() -> tuple[World, bytes]:
    """A few seconds of everything in one room."""
    world = _world("escorts:3,boards:1,cleaners:1,groups:2", n_chairs=4)
    world.set_command(0.4, 0.3)
    _watch(world, 6.0)
    return world, world.save_state()


def test_a_crowd_goes_on_from_a_saved_state(mixed: tuple[World, bytes]):
    world, saved = mixed
    _watch(world, 3.0)
    other = _world("escorts:3,boards:1,cleaners:1,groups:2", n_chairs=4)
    other.load_state(saved)
    other.set_command(0.4, 0.3)
    _watch(other, 3.0)
    assert other.save_state() == world.save_state()
    assert other.step_count == 9 * SUBSTEPS_PER_S


def test_nobody_walks_through_anybody(mixed: tuple[World, bytes]):
    world, _ = mixed
    people = world.people.crowd
    n = len(people.task)
    xy = np.stack([people.discs["x"], people.discs["y"]], axis=1)
    gaps = np.linalg.norm(xy[:n, None] - xy[None], axis=2)
    gaps -= people.discs["r"][:n, None] + people.discs["r"][None]
    gaps[np.arange(n), np.arange(n)] = 1.0
    assert gaps.min() > -0.03
    assert sum(world.data.warning[k].number for k in range(len(world.data.warning))) == 0


def test_who_has_put_a_chair_down_is_pushed_by_nothing():
    simulation = Simulation(
        "arena", seed=3, motion=0.5, change=0.0, crowd="cleaners:2", n_chairs=8, n_people=0
    )
    world = simulation.world
    held = world.people.table.held.at
    had, empty = np.zeros(len(held), dtype=bool), 0
    for _ in tour(simulation, 20.0):
        for k in np.flatnonzero(had & (held["qb"] < 0) & (held["dropped"] < 0)):
            empty += 1
            first = held["va"][k]
            assert (world.data.qfrc_applied[first : first + 3] == 0.0).all()
        had |= held["qb"] >= 0
    assert empty > 20
