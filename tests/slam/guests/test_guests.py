# SPDX-License-Identifier: Apache-2.0
"""Guests speak the protocol, follow a known drive, and lose a run when they fail."""

import ctypes
import importlib
import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slam import create
from slam.errors import (
    InvalidValueError,
    MissingDependencyError,
    SlamFailedError,
    UnknownNameError,
)
from slam.evaluation import metrics
from slam.frames import Float, Frame, LaserSpec, Odometry
from slam.frontend.odometry_prior import Prediction
from slam.guests import Guest
from slam.guests.genz import quiet
from slam.replay import Replay, Track
from tests.world2d import World2D, arena, frames, laser, wander

pytestmark = pytest.mark.slow
MODULES = {
    "genz-icp": "genz_icp",
    "karto": "karto_scanmatcher",
    "kiss-icp": "kiss_icp",
    "small-gicp": "small_gicp",
    "yag-slam": "yag_slam",
}
PROGRAMS = ("icp-slam", "rbpf-slam")
GUESTS = (*MODULES, *PROGRAMS)
EXTRAS = {"yag-slam": "yag"}
AS_NEAR_M = {"rbpf-slam": 0.08}  # its particles' mean; the others 4 cm


def needs(name: str) -> None:
    """Skip where the guest is not installed."""
    if name in PROGRAMS:
        if shutil.which(name) is None:
            pytest.skip(f"the program '{name}' is not there: apt-get install mrpt-apps")
    else:
        pytest.importorskip(MODULES[name])


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    return frames(World2D(arena()), wander(15.0), rate_hz=5.0, spec=laser(181), seed=4)


@pytest.mark.parametrize("name", GUESTS)
def test_a_guest_follows_the_drive_better_than_the_wheels(name: str, stream: list[Frame]) -> None:
    needs(name)
    replay = Replay.of({"guest": create(name), "odometry": create("odometry")})
    assert sum(1 for _ in replay.run(stream)) == len(stream)
    truth = replay.truth()
    assert truth is not None
    errors = {
        n: metrics.ate(track.online(), truth, align="se2") for n, track in replay.tracks.items()
    }
    assert errors["guest"].value < min(AS_NEAR_M.get(name, 0.04), 0.5 * errors["odometry"].value)
    np.testing.assert_array_equal(replay.tracks["guest"].online().poses[0], 0.0)
    final = replay.tracks["guest"].final()
    assert final is None or metrics.ate(final, truth, align="se2").value < 0.04


@pytest.mark.parametrize("name", GUESTS)
def test_a_guest_begins_anew_and_repeats_itself(name: str, stream: list[Frame]) -> None:
    needs(name)
    system = create(name)
    track = Track(name, system)
    assert track.survive(stream[:8]) is None
    system.reset()
    again = Track(name, system)
    assert again.survive(stream[:8]) is None
    np.testing.assert_allclose(again.online().poses, track.online().poses, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("genz-icp", "max_num_iterations=1"),
        ("karto", "search_size=0.02"),
        ("kiss-icp", "voxel_size=1.0"),
        ("small-gicp", "max_iterations=1"),
    ],
)
def test_a_guest_has_numbers_by_its_own_names(name: str, number: str, stream: list[Frame]) -> None:
    needs(name)
    tracks = [Track(one, create(one)) for one in (name, f"{name}{{{number}}}")]
    for track in tracks:
        assert track.survive(stream[:12]) is None
    assert not np.allclose(*(track.online().poses for track in tracks), atol=1e-6)
    with pytest.raises(UnknownNameError, match="Config has no 'nothing'"):
        create(f"{name}{{nothing=1}}")


def test_kartos_grid_keeps_its_odd_side(stream: list[Frame], capfd: pytest.CaptureFixture) -> None:
    needs("karto")
    track = Track("karto", create("karto{search_size=0.36,resolution=0.011}"))
    assert track.survive(stream[:5]) is None
    assert "out of range" not in "".join(capfd.readouterr())


def dark(frame: Frame) -> Frame:
    """The frame with a scan without returns."""
    assert frame.scan is not None
    ranges = np.full(frame.scan.spec.n_beams, np.inf, dtype=np.float32)
    return replace(frame, scan=replace(frame.scan, ranges=ranges))


@pytest.mark.parametrize("name", GUESTS)
def test_a_guest_bears_a_dark_scan_and_refuses_one_out_of_order(
    name: str, stream: list[Frame]
) -> None:
    needs(name)
    track = Track(name, create(name))
    frames = [dark(stream[0]), *stream[1:4], dark(stream[4]), stream[5]]
    for frame in frames:
        track.take(frame.without_truth())
    with pytest.raises(InvalidValueError, match="in order"):
        track.system.update(stream[5])
    assert track.online().stamps_ns.tolist() == [frame.stamp_ns for frame in frames]
    final = track.final()
    assert final is None or len(final) == len(frames)


def closed_loops(monkeypatch: pytest.MonkeyPatch, stream: list[Frame], fine: float) -> int:
    """Of YAG SLAM, where every chain near is tried, and ``fine`` is the least response."""
    for name, value in {
        "COARSE": 0.0,
        "FINE": fine,
        "CHAIN": 1,
        "BUFFER": 3,
        "KEEP_M": 0.05,
    }.items():
        monkeypatch.setattr(f"slam.guests.yag.{name}", value)
    graph = importlib.import_module("yag_slam.graph_slam").GraphSlam
    closed: list[object] = []
    optimise = graph.run_opt
    monkeypatch.setattr(graph, "run_opt", lambda self: (closed.append(self), optimise(self)))
    system = create("yag-slam")
    for frame in stream:
        system.update(frame.without_truth())
    return len(closed)


def test_yag_slam_closes_no_loop_below_its_fine_response(
    monkeypatch: pytest.MonkeyPatch, stream: list[Frame], capfd: pytest.CaptureFixture[str]
) -> None:
    needs("yag-slam")
    assert closed_loops(monkeypatch, stream, 0.0) > 0
    assert closed_loops(monkeypatch, stream, 2.0) == 0
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("name", MODULES)
def test_a_guest_that_is_not_installed_says_how_to_get_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [m for m in sys.modules if m.partition(".")[0] == MODULES[name]]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, MODULES[name], None)
    extra = EXTRAS.get(name, "guests")
    with pytest.raises(MissingDependencyError, match=rf"pip install 'mobilia\[{extra}\]'"):
        create(name)


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_that_is_not_installed_says_how_to_get_it(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingDependencyError, match="apt-get install mrpt-apps"):
        create(name)


class Failing(Guest):
    """Ends nowhere at its fourth scan."""

    def begin(self, spec: LaserSpec) -> None:
        self.scanner = spec

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        place = prediction.T_map_robot.copy()
        if len(self._path) == 3:
            place[0] = np.nan
        return place, {}


def test_a_guest_that_ends_nowhere_has_lost_the_run(stream: list[Frame]) -> None:
    track = Track("failing", Failing())
    failure = track.survive(stream)
    assert isinstance(failure, SlamFailedError)
    assert "scan 3" in str(failure)
    assert "got [nan" in str(failure)
    assert f"(test_guests.py:{Failing.locate.__code__.co_firstlineno})" in str(failure)
    assert len(track.estimates) == 3
    assert Track("odometry", create("odometry")).survive(stream) is None


def test_a_guest_refuses_what_it_cannot_use(stream: list[Frame]) -> None:
    blind = Frame(stamp_ns=9, odometry=Odometry(stamp_ns=9, T_odom_robot=np.zeros(3)))
    with pytest.raises(InvalidValueError, match="needs a laser scan"):
        Failing().update(blind)
    guest = Failing()
    guest.update(stream[1])
    with pytest.raises(InvalidValueError, match="in order"):
        guest.update(stream[0])


def test_what_is_written_within_is_dropped_and_nothing_else(capfd: pytest.CaptureFixture[str]):
    libc = ctypes.CDLL(None)
    open_before = set(os.listdir("/dev/fd"))
    libc.puts(b"before")  # C keeps it for later
    with quiet():
        libc.puts(b"within, kept")
        os.write(1, b"within\n")
    libc.puts(b"between")
    with pytest.raises(ZeroDivisionError), quiet():
        libc.puts(b"within, kept") / 0
    libc.puts(b"after")
    libc.fflush(None)
    assert capfd.readouterr().out == "before\nbetween\nafter\n"
    assert set(os.listdir("/dev/fd")) == open_before
