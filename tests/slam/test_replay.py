# SPDX-License-Identifier: Apache-2.0
"""A replay gives every SLAM the same frames and never the truth."""

import pickle
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from slam.errors import SlamFailedError
from slam.estimate import Landmarks
from slam.frames import Frame
from slam.odometry import OdometrySlam
from slam.replay import Replay, Track
from slam.system import Estimate, Raster, create
from slam.trajectory import Trajectory
from tests.world2d import frame_at


def frames(n: int = 5) -> list[Frame]:
    return [frame_at(k, (0.1 * k, 0.0, 0.0), truth=np.array([0.2 * k, 1.0, 0.0])) for k in range(n)]


class Peeping:
    """Records whether it ever saw the truth; its final poses differ from its online ones."""

    def __init__(self) -> None:
        self.saw_truth = False
        self.stamps: list[int] = []

    def reset(self) -> None:
        self.stamps = []

    def update(self, frame: Frame) -> Estimate:
        self.saw_truth |= frame.truth is not None or frame.labels is not None
        self.stamps.append(frame.stamp_ns)
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=np.zeros(3), covariance=np.zeros((3, 3))
        )

    def map(self) -> Raster | None:
        return None

    def trajectory(self) -> Trajectory:
        return Trajectory(
            stamps_ns=np.array(self.stamps, dtype=np.int64), poses=np.ones((len(self.stamps), 3))
        )


def test_no_system_sees_the_truth_and_the_caller_does():
    replay = Replay.of({"odometry": create("odometry"), "peeping": Peeping()})
    seen = list(replay.run(frames()))
    peeping = replay.tracks["peeping"].system
    assert isinstance(peeping, Peeping)
    assert not peeping.saw_truth
    assert all(frame.truth is not None for frame in seen)
    truth = replay.truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.poses[:, 0], [0.2 * k for k in range(5)])


def test_online_and_final_poses_are_kept_apart():
    replay = Replay.of({"odometry": create("odometry"), "peeping": Peeping()})
    for _ in replay.run(frames()):
        pass
    assert replay.tracks["odometry"].final() is None
    final = replay.tracks["peeping"].final()
    assert final is not None
    np.testing.assert_array_equal(final.poses, 1.0)
    np.testing.assert_array_equal(replay.tracks["peeping"].online().poses, 0.0)
    assert len(replay.tracks["odometry"].durations_s) == 5


class Guest(Peeping):
    """Misbehaves at its third frame in a way given at birth."""

    def __init__(self, answer) -> None:
        super().__init__()
        self.answer = answer

    def update(self, frame: Frame) -> Estimate:
        return self.answer(frame) if len(self.stamps) == 2 else super().update(frame)


def fail(_frame: Frame) -> Estimate:
    raise ZeroDivisionError("too clever")


@pytest.mark.parametrize(
    ("answer", "says", "outcome"),
    [
        (fail, "raised ZeroDivisionError: too clever", "raised"),
        (lambda frame: None, "returned no Estimate but None", "bad"),
        (
            lambda frame: Estimate(
                stamp_ns=frame.stamp_ns, T_map_robot=np.zeros(2), covariance=np.eye(3)
            ),
            "T_map_robot must have shape (3)",
            "bad",
        ),
        (
            lambda frame: Estimate(
                stamp_ns=frame.stamp_ns, T_map_robot=[0, float("nan"), 0], covariance=np.eye(3)
            ),
            "T_map_robot must be finite",
            "nan",
        ),
        (
            lambda frame: Estimate(
                stamp_ns=frame.stamp_ns, T_map_robot=np.zeros(3), covariance=np.zeros((2, 2))
            ),
            "covariance must have shape (3, 3), got (2, 2)",
            "bad",
        ),
        (
            lambda frame: Estimate(
                stamp_ns=frame.stamp_ns,
                T_map_robot=np.zeros(3),
                covariance=np.eye(3),
                converged="no",
            ),
            "converged must be True or False, got 'no'",
            "bad",
        ),
        (lambda frame: sys.exit(3), "raised SystemExit: 3", "raised"),
        (
            lambda frame: Estimate(stamp_ns=7, T_map_robot=np.zeros(3), covariance=np.eye(3)),
            "for 7 ns instead of 2 ns",
            "bad",
        ),
    ],
)
def test_a_failing_guest_is_named_with_the_scan_and_how_it_failed(answer, says, outcome):
    replay = Replay.of({"guest": Guest(answer)})
    with pytest.raises(SlamFailedError, match=rf"SLAM 'guest', scan 2, .*{re.escape(says)}") as got:
        list(replay.run(frames()))
    assert got.value.outcome == outcome
    assert re.search(r" \(test_replay\.py:\d+\)$", str(got.value))
    copied = pickle.loads(pickle.dumps(got.value))
    assert (str(copied), copied.outcome) == (str(got.value), outcome)


def test_the_line_of_a_failure_is_the_guests_own():
    def inverts(_frame: Frame) -> Estimate:
        return np.linalg.inv(np.zeros((2, 2)))

    with pytest.raises(SlamFailedError) as got:
        list(Replay.of({"guest": Guest(inverts)}).run(frames()))
    line = inverts.__code__.co_firstlineno + 1
    assert str(got.value).endswith(f"LinAlgError: Singular matrix (test_replay.py:{line})")


class Mapper(OdometrySlam):
    """One with the optional methods."""

    cells_hold = "guesses"

    def landmarks(self):
        return Landmarks(
            keys=np.array([3]), points_map=np.ones((1, 2)), covariances=np.eye(2)[None],
            looks=np.array([1]),
        )  # fmt: skip

    def changes(self):
        return self.found

    def save(self, path):
        if path.suffix != ".map":
            raise RuntimeError("no such format")
        path.write_text("mine")


def test_optional_methods_are_asked_for_where_they_are(tmp_path):
    plain, mapper = Track("plain", OdometrySlam()), Track("mapper", Mapper())
    assert (plain.landmarks(), plain.changes(), plain.cells_hold()) == (None, None, "")
    assert not plain.save(tmp_path / "a.map")
    assert list(tmp_path.iterdir()) == []
    assert mapper.landmarks().keys.tolist() == [3]
    assert mapper.cells_hold() == "guesses"
    assert mapper.save(tmp_path / "a.map")
    assert (tmp_path / "a.map").read_text() == "mine"


def test_optional_methods_of_somebody_else_fail_by_name(tmp_path):
    track = Track("mapper", Mapper())
    track.system.found = "a lot"
    with pytest.raises(SlamFailedError, match=r"'mapper', changes\(\) returned no Changes or None"):
        track.changes()
    with pytest.raises(SlamFailedError, match=r"'mapper', save\(\) raised RuntimeError: no such"):
        track.save(tmp_path / "a.png")
    track.system.landmarks = list
    with pytest.raises(SlamFailedError, match=r"landmarks\(\) returned no Landmarks but \[\]"):
        track.landmarks()


class Far(Peeping):
    """Answers what ``pose`` and ``raster`` say."""

    def __init__(self, pose: tuple[float, ...] = (0.0, 0.0, 0.0), **raster: object) -> None:
        super().__init__()
        self.pose, self.raster = pose, raster

    def update(self, frame: Frame) -> Estimate:
        return replace(super().update(frame), T_map_robot=np.array(self.pose))

    def map(self) -> Raster | None:
        whole = {"values": np.zeros((2, 2)), "resolution_m": 0.1, "T_map_origin": np.zeros(3)}
        return Raster(**{**whole, **self.raster})


@pytest.mark.parametrize("pose", [(1e300, 0.0, 0.0), (0.0, -2e9, 0.0), (0.0, 0.0, 1e10)])
def test_a_place_that_no_picture_holds_is_no_answer(pose):
    failure = Track("far", Far(pose)).survive(frames())
    assert failure is not None
    assert (failure.outcome, "m or rad, past 1e+09" in str(failure)) == ("bad", True)


@pytest.mark.parametrize(
    ("raster", "says"),
    [
        ({"resolution_m": 1e-300}, "cells of 1e-300 m, they may have 0.001 to 1000"),
        ({"resolution_m": 1e300}, "cells of 1e+300 m"),
        ({"T_map_origin": np.array([0.0, 1e300, 0.0])}, "a map at 1e+300 m or rad"),
    ],
)
def test_a_map_that_no_picture_holds_is_no_answer(raster, says):
    assert Track("near", Far()).map() is not None
    with pytest.raises(SlamFailedError, match=re.escape(says)) as got:
        Track("far", Far(**raster)).map()
    assert got.value.outcome == "bad"
