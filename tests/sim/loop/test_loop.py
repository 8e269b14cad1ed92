# SPDX-License-Identifier: Apache-2.0
"""The closed loop: only the estimate steers, truth only scores, whatever the SLAM does."""

from dataclasses import replace

import numpy as np
import pytest

import scenes
from sim.core.dynamism import Dynamism
from sim.loop import LoopConfig, closed_loop
from sim.loop.run import goal_order
from sim.simulation import Simulation
from slam import Estimate, create, se2
from slam.errors import InvalidValueError, UnknownNameError
from slam.odometry import OdometrySlam

pytestmark = pytest.mark.slow
NEAR = ["north_east"]


class Seer:
    """Knows the truth of a simulation and says it shifted, or worse."""

    def __init__(self, simulation, offset=(0.0, 0.0, 0.0), after=None, what=None):
        self.simulation, self.offset = simulation, np.array(offset)
        self.after, self.what = after, what

    def reset(self):
        self.first, self.count = None, 0

    def update(self, frame):
        assert frame.truth is None
        truth = self.simulation.frame.truth
        self.first = truth if self.first is None else self.first
        self.count += 1
        if self.what is not None and self.count > self.after:
            return self.what(frame)
        # the offset is one of the world: the robot starts at heading 0 in the arena
        pose = se2.between(self.first, truth) + self.offset
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))

    def map(self):
        return None

    def trajectory(self):
        raise NotImplementedError


def arena(seed=1, dynamism=0.0, **options):
    return Simulation("arena", seed=seed, dynamism=dynamism, **options)


def drive(simulation, system, goals=NEAR, **config):
    return closed_loop(simulation, system, config=LoopConfig(**config), goals=goals)


def bytes_of(run):
    return run.believed.tobytes() + run.commands.tobytes()


def test_who_is_told_the_truth_arrives():
    simulation = arena()
    run = drive(simulation, Seer(simulation))
    assert [goal.outcome for goal in run.goals] == ["reached"]
    assert run.goals[0].precision_m < 0.1
    assert run.lost_s is None


@pytest.mark.parametrize(("offset", "outcome"), [(0.3, "reached"), (0.7, "wrong")])
def test_an_offset_is_exactly_what_it_is_off_by_in_the_end(offset, outcome):
    simulation = arena(n_chairs=0)
    run = drive(simulation, Seer(simulation, (offset, 0.0, 0.05)))
    goal, config = run.goals[0], LoopConfig()
    assert goal.outcome == outcome
    place = np.array(simulation.world.scene.goals[NEAR[0]])
    missed = run.true[-1, :2] - place
    assert np.hypot(missed[0] + offset, missed[1]) < config.arrive_m
    assert goal.precision_m == pytest.approx(np.hypot(*missed), abs=1e-12)
    assert goal.precision_rad == pytest.approx(0.05, abs=1e-12)
    assert (run.lost_s is not None) == (offset > 0.5)


def test_truth_scores_and_does_nothing_else(monkeypatch):
    run = drive(arena(dynamism=1.0), create("odometry"))
    observe = Simulation.observe

    def shifted(self):
        frame = observe(self)
        return replace(frame, truth=frame.truth + np.array([2.0, 1.0, 0.3]))

    monkeypatch.setattr(Simulation, "observe", shifted)
    other = drive(arena(dynamism=1.0), create("odometry"))
    assert bytes_of(other) == bytes_of(run)
    assert other.goals[0].outcome == "wrong"
    assert other.lost_s is not None


def test_every_slam_gets_the_same_goals_and_the_same_movers():
    def once(offset):
        simulation = arena(5, dynamism=Dynamism.world_1(1.0))
        run = drive(simulation, Seer(simulation, offset), goals=2, limit_s=3.0)
        return [goal.goal for goal in run.goals], simulation.world.mover_poses(), run.true

    goals, movers, path = once((0.0, 0.0, 0.0))
    other_goals, other_movers, other_path = once((0.0, 0.0, 0.8))
    assert goals == other_goals
    assert not np.allclose(path[-1], other_path[-1], atol=0.1)
    same = np.isclose(movers, other_movers, atol=1e-6).all(axis=1)
    assert same[:-1].mean() > 0.7  # but for what was touched, or pushed by what was


def test_a_slam_that_raises_has_failed_and_the_run_goes_on_to_be_scored():
    simulation = arena()

    def crash(frame):
        raise RuntimeError("out of ideas")

    run = drive(simulation, Seer(simulation, after=5, what=crash), goals=2)
    assert [(goal.outcome, goal.reason) for goal in run.goals] == [("failed", "raised")] * 2
    assert "out of ideas" in run.failure[1]
    assert len(run.believed) == 5


def test_a_kidnapped_estimate_is_lost_and_scored():
    simulation = arena(n_chairs=0)

    def elsewhere(frame):
        pose = np.array([30.0, 30.0, 2.0])
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))

    run = drive(simulation, Seer(simulation, after=10, what=elsewhere), patience_s=4.0)
    assert run.goals[0].outcome == "given up"
    assert run.lost_s == pytest.approx(10 * 4 / 37.5, abs=0.2)
    assert run.found_s is None


def test_a_slam_in_doubt_slows_down_then_looks_about_and_claims_nothing():
    simulation = arena(n_chairs=0)

    def doubtful(frame):
        truth = se2.between(simulation.world.scene.start, simulation.frame.truth)
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=truth, covariance=np.eye(3), converged=False
        )

    run = drive(simulation, Seer(simulation, after=20, what=doubtful), limit_s=6.0)
    assert run.goals[0].outcome == "given up"
    sure, doubt = run.commands[:20], run.commands[21:]
    assert np.abs(doubt[:, 0]).max() <= 0.51 * np.abs(sure[:, 0]).max()
    assert (doubt[-10:-1, 0] == 0.0).all()
    assert (doubt[-10:-1, 1] != 0.0).all()


def walled_in():
    """The arena with a goal in a closet without a door (on the plan; nothing is built)."""
    scene = scenes.build("arena", 0, n_chairs=0)
    x, y = 3.0, 0.0
    walls = [[x, y + 0.8, 0.9, 0.05, 0], [x, y - 0.8, 0.9, 0.05, 0],
             [x + 0.8, y, 0.05, 0.9, 0], [x - 0.8, y, 0.05, 0.9, 0]]  # fmt: skip
    return replace(
        scene,
        goals={**scene.goals, "closet": (x, y)},
        obstacles=np.concatenate([scene.obstacles, walls]),
    )


def test_a_goal_without_a_way_is_said_and_the_next_is_tried():
    simulation = Simulation(walled_in(), seed=0, dynamism=0.0)
    run = drive(simulation, create("odometry"), goals=["closet", "north_east"])
    assert [(g.outcome, g.reason) for g in run.goals] == [("given up", "no way"), ("reached", "")]


def test_on_its_own_map_it_finds_its_way_too():
    run = drive(arena(), create("shunting"), plan_on="map")
    assert run.goals[0].outcome == "reached"
    assert run.goals[0].precision_m < 0.3


def test_goals_are_all_so_many_or_the_named_ones():
    world = arena().world
    everything = goal_order(world)
    assert sorted(everything) == sorted(world.scene.goals)
    assert goal_order(world, 2) == everything[:2]
    with pytest.raises(UnknownNameError, match="no goal 'cellar'"):
        goal_order(world, ["cellar"])


def test_a_slam_that_runs_at_the_end_only_is_refused():
    class OverFiles(OdometrySlam):
        def estimates_at_end(self):
            return []

    with pytest.raises(InvalidValueError, match=r"'slam' is a program over files.*a closed loop"):
        drive(arena(), OverFiles())
