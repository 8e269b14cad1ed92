# SPDX-License-Identifier: Apache-2.0
"""The oracle: movers' returns are taken out by the labels, nothing else is, and nobody else sees
labels."""

import copy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slam
from slam.errors import InvalidValueError, NeedsLabelsError, UnknownNameError, UntrustedNameError
from slam.estimate import Estimate
from slam.frames import BeamClass, BeamLabels, Frame
from slam.guests import Limits, PipeSlam, limited
from slam.names import NameFromFile
from slam.odometry import OdometrySlam
from slam.oracle import Oracle, shown, without
from slam.replay import Replay, Track
from slam.set_numbers import with_set
from slam.system import check_name
from slam.variants import oracle_named, oracle_of
from tests.slam.guests import misbehaving
from tests.world2d import Drive, World2D, arena, frames, laser

STATIC, SEMI, MOVING = BeamClass.STATIC, BeamClass.SEMI_STATIC, BeamClass.MOVING


def labelled(frame: Frame, kind: np.ndarray) -> Frame:
    n = len(kind)
    labels = BeamLabels(
        body=np.zeros(n, dtype=np.int32),
        kind=kind.astype(np.uint8),
        displacement=np.zeros(n, dtype=np.float32),
        incidence=np.zeros(n, dtype=np.float32),
        mixed=np.zeros(n, dtype=np.bool_),
    )
    return replace(frame, labels=labels)


def tour(kinds: tuple[BeamClass, ...]) -> list[Frame]:
    """Scans of 91 beams of an empty room, each beam said to be one of ``kinds``."""
    drive = Drive((0.0, 0.0, 0.0), ((0.3, 0.4, 1.0),))
    plain = frames(World2D(arena()), drive, rate_hz=5.0, spec=laser(91), seed=3)
    rng = np.random.default_rng(0)
    return [labelled(frame, rng.choice(kinds, 91)) for frame in plain]


class Watcher(OdometrySlam):
    """Odometry that keeps what it was shown."""

    cells_hold = "guesses"

    def __init__(self) -> None:
        self.seen: list[Frame] = []
        super().__init__()

    def update(self, frame: Frame) -> Estimate:
        self.seen.append(frame)
        return super().update(frame)

    def save(self, path: Path) -> None:
        path.write_text(str(len(self.seen)))


@pytest.mark.parametrize(
    ("takes_out", "gone"), [("movable", (SEMI, MOVING)), ("moving", (MOVING,))]
)
def test_the_slam_sees_all_returns_but_the_movers(takes_out: str, gone: tuple[BeamClass, ...]):
    """Two-sided: no labelled return comes through, and every other beam is as it was."""
    stream, watcher = tour((STATIC, SEMI, MOVING)), Watcher()
    track = Track("oracle", Oracle(watcher, takes_out))
    assert track.survive(stream) is None
    for frame, seen in zip(stream, watcher.seen, strict=True):
        assert frame.scan is not None
        assert frame.labels is not None
        assert seen.scan is not None
        out = np.isin(frame.labels.kind, gone)
        assert out.any()
        assert not out.all()
        assert np.isnan(seen.scan.ranges[out]).all()
        assert not seen.scan.valid[out].any()
        assert np.array_equal(seen.scan.ranges[~out], frame.scan.ranges[~out])
        assert seen.scan.spec is frame.scan.spec
        assert seen.labels is None
        assert seen.truth is None
        assert seen.odometry == frame.odometry


def test_without_movers_the_estimates_are_the_slams_byte_for_byte():
    stream = tour((BeamClass.NONE, STATIC))
    replay = Replay.of({name: slam.create(name) for name in ("shunting", "oracle(shunting)")})
    list(replay.run(stream))
    ours, oracles = replay.tracks.values()
    for a, b in zip(ours.estimates, oracles.estimates, strict=True):
        assert a.T_map_robot.tobytes() == b.T_map_robot.tobytes()
        assert a.covariance.tobytes() == b.covariance.tobytes()
    mapped = [track.map() for track in (ours, oracles)]
    assert mapped[0] is not None
    assert mapped[1] is not None
    assert mapped[0].values.tobytes() == mapped[1].values.tobytes()
    assert ours.cells_hold() == oracles.cells_hold()
    assert oracles.changes() is not None


def test_intensities_of_what_is_taken_out_are_gone_too():
    frame = tour((STATIC, MOVING))[0]
    assert frame.scan is not None
    assert frame.labels is not None
    scan = replace(frame.scan, intensities=np.ones(91))
    kind = frame.labels.kind
    cleared = without(scan, kind, "moving")
    assert cleared.intensities is not None
    assert np.array_equal(cleared.intensities == 0.0, kind == MOVING)
    assert without(scan, np.full(91, STATIC), "movable") is scan


def test_labels_are_for_an_oracle_alone():
    frame = tour((STATIC, MOVING))[0]

    class Pretender(Oracle):
        """Not ours."""

    assert shown(Watcher(), frame).labels is None
    assert shown(Pretender(Watcher()), frame).labels is None
    assert shown(Oracle(Watcher()), frame).labels is frame.labels
    assert shown(Oracle(Watcher()), frame).truth is None
    watchers = {"a": Watcher(), "b": Oracle(Watcher())}
    list(Replay.of(watchers).run([frame]))
    assert watchers["a"].seen[0] == frame.without_truth()


def test_optional_methods_are_the_slams(tmp_path: Path):
    oracle = slam.create("oracle(odometry)")
    assert not hasattr(oracle, "save")
    assert not hasattr(oracle, "landmarks")
    track = Track("oracle", Oracle(Watcher()))
    track.take(tour((STATIC,))[0])
    assert track.cells_hold() == "guesses"
    assert track.save(tmp_path / "map")
    assert (tmp_path / "map").read_text() == "1"
    other = copy.deepcopy(track.system)
    track.take(tour((STATIC,))[1])
    other.save(tmp_path / "other")  # type: ignore[attr-defined]
    assert (tmp_path / "other").read_text() == "1"
    assert len(track.system.trajectory()) == 2
    track.system.reset()
    assert len(track.system.trajectory()) == 0


def test_frames_without_labels_say_what_has_some():
    blind = tour((STATIC,))[0].without_truth()
    with pytest.raises(NeedsLabelsError, match=r"oracle\(.*--scene.*labels=True"):
        Track("oracle", slam.create("oracle(odometry)")).take(blind)


def test_names_there_and_back():
    assert oracle_of("shunting") is None
    assert oracle_of("oracle(shunting)") == ("shunting", "movable")
    assert oracle_of("oracle( ekf, moving )") == ("ekf", "moving")
    assert oracle_of("oracle(ekf{a=1,b=2},moving)") == ("ekf{a=1,b=2}", "moving")
    assert oracle_of("oracle(pipe:./it a,b)") == ("pipe:./it a,b", "movable")
    assert oracle_named("ekf") == oracle_named("ekf,movable") == "oracle(ekf)"
    assert oracle_named("ekf,moving") == "oracle(ekf,moving)"
    tricky = oracle_named("pipe:./it moving,moving,movable")
    assert oracle_of(tricky) == ("pipe:./it moving,moving", "movable")
    made = slam.create("oracle(shunting{cell_m=0.1},moving)")
    assert isinstance(made, Oracle)
    assert made.takes_out == "moving"
    assert slam.config_of("oracle(shunting{cell_m=0.1})") == slam.config_of("shunting{cell_m=0.1}")
    assert with_set(["shunting", "oracle(shunting,moving)"], ["reward=7"]) == (
        "shunting{reward=7}", "oracle(shunting{reward=7},moving)",
    )  # fmt: skip
    assert with_set(["ekf", "oracle(shunting)"], ["ekf.detection=0.5"]) == (
        "ekf{detection=0.5}", "oracle(shunting)",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "error", "says"),
    [
        ("oracle(shuntin)", UnknownNameError, "Did you mean 'shunting'"),
        ("oracle", UnknownNameError, r"oracle\(SLAM\)"),
        ("oracle(shunting", InvalidValueError, r"without '\)'"),
        ("oracle(oracle(shunting))", InvalidValueError, "no oracle"),
        ("oracle(shunting,sometimes)", InvalidValueError, "movable or moving.*'sometimes'"),
    ],
)
def test_wrong_names(name: str, error: type[Exception], says: str):
    for wrong in (slam.create, check_name):
        with pytest.raises(error, match=says):
            wrong(name)


def test_what_is_no_mode_and_no_trusted_name_is_refused():
    with pytest.raises(InvalidValueError, match="takes_out"):
        Oracle(OdometrySlam(), "everything")
    code = NameFromFile("oracle(tests.slam.test_oracle:Watcher)", "there.json")
    for make in (slam.create, lambda name: limited(name, Limits())):
        with pytest.raises(UntrustedNameError, match=r"there\.json"):
            make(code)


def test_one_from_outside_runs_in_its_own_process_and_sees_no_label():
    """The labels stay here: what is sent over the pipe is the cleared scan."""
    command = f"oracle(pipe:{sys.executable} -S -E {misbehaving.__file__} none)"
    system = limited(command, Limits())
    assert isinstance(system, Oracle)
    assert isinstance(system.slam, PipeSlam)
    track = Track("outside", system)
    assert track.survive(tour((STATIC, MOVING))[:3]) is None
    assert hasattr(system, "memory_growth_bytes")
    assert hasattr(system, "processor_s")
