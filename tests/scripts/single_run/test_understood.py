# SPDX-License-Identifier: Apache-2.0
"""What a run says of its log: where the scanner is, what flag to give, why it was not trusted."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
from scripts import cli
from scripts.film.footage import Footage, of_log
from scripts.single_run import log_words
from slam.days.session import SEARCHING
from slam.errors import InvalidValueError
from tests.world2d import World2D, frames, laser, office, office_loop

FLAT = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Writes the bag of one drive; its scanner looks back, which ``transform`` says or not."""
    driven = frames(World2D(office()), office_loop(), rate_hz=2.0, spec=laser(91), seed=4)

    def write(name: str, *, transform: bool) -> Path:
        make = bags.Maker()
        turned = (0.0, 0.0, 1.0, 0.0)  # half a turn
        first = bags.START_NS
        out = [make.transform(first, "base_link", "laser", (0.1, 0.0, 0.0), turned)]
        out = out if transform else []
        for frame in driven:
            assert frame.scan is not None
            stamp = first + frame.stamp_ns
            back = {
                "angle_min": math.pi / 2.0, "angle_max": 1.5 * math.pi,
                "angle_increment": math.pi / 90.0,
            }  # fmt: skip
            out.append(make.odometry(stamp, frame.odometry.T_odom_robot))
            out.append(make.scan(stamp, frame.scan.ranges, **back))
        return bags.write_ros2(tmp_path_factory.mktemp("bags") / name, out, "mcap")

    return write


@pytest.fixture(scope="module")
def without(bag: Any) -> Path:
    return bag("without", transform=False)


def said(footage: Footage, capsys: pytest.CaptureFixture[str], caplog: Any) -> tuple[str, str]:
    log_words.tell(footage, strict=False)
    return capsys.readouterr().out.strip(), caplog.text


def test_a_bag_with_a_transform_says_where_it_is_from_and_nothing_else(
    bag: Any, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    line, warned = said(of_log(bag("with", transform=True)), capsys, caplog)
    assert "/scan" in line
    assert "91 beams over 180° (counter-clockwise)" in line
    assert "x 0.1 m, y 0 m, turned 180° on the robot, by base_link -> laser of /tf_static" in line
    assert "at 2 Hz" in line
    assert warned == ""


def test_a_scanner_mounted_backwards_without_transform_is_named_with_its_flag(
    without: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    line, warned = said(of_log(without), capsys, caplog)
    assert "turned 0° on the robot, assumed" in line
    assert "does not say how the scanner is mounted" in warned
    assert "agree under --laser 0,0,180 (" in warned
    assert "more than 1000 to 1" in warned
    with pytest.raises(InvalidValueError, match="refused by --strict"):
        log_words.tell(of_log(without), strict=True)


def test_with_the_flag_that_was_asked_for_all_is_well(
    without: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    footage = of_log(without, mounts=[log_words.mount_of("0.1,0,180")])
    line, warned = said(footage, capsys, caplog)
    assert "turned 180° on the robot, by --laser" in line
    assert warned == ""
    flipped = said(
        of_log(without, mounts=[log_words.mount_of("0 0 180")], flip=True), capsys, caplog
    )
    assert "agree under --laser 0,0,180 --flip (" in flipped[1]


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match="--laser must be x,y,yaw_deg"):
        log_words.mount_of(text)


def test_a_run_that_nobody_trusts_names_the_likeliest_cause_first(without: Path) -> None:
    footage = of_log(without)
    (test,) = footage.tested.values()
    found = test.told()

    def track(doubted: int) -> Any:
        estimates = [SimpleNamespace(converged=k >= doubted, diagnostics={}) for k in range(10)]
        return SimpleNamespace(name="mine", estimates=estimates)

    assert log_words.distrust(track(3), footage, found) == ""
    started = track(4)
    for one in started.estimates[:3]:
        one.diagnostics["state"] = SEARCHING
    assert log_words.distrust(started, footage, found) == ""
    words = log_words.distrust(track(4), footage, found)
    assert words.startswith("mine did not trust 40% of its scans. Likely causes, in order: the sc")
    assert np.all([word in words for word in ("different clocks", "wheels that slip")])
    footage.empty = 0.5
    assert "50% of the scans return less than 10 % of beams" in log_words.distrust(
        track(4), footage, []
    )


@pytest.mark.parametrize("limit", [30.0, 30_000.0])
def test_ranges_in_mm_are_told_and_named_first(tmp_path: Path, limit: float) -> None:
    make = bags.Maker()
    out = []
    for k in range(4):
        at = bags.START_NS + k * 10**8
        ranges = [1500.0, 2500.0, 4000.0, math.inf]
        out += [make.odometry(at, (0, 0, 0)), make.scan(at, ranges, range_max=limit)]
    footage = of_log(bags.write_ros2(tmp_path / "mm", out))
    assert log_words.units(footage).startswith("ranges look like mm: the median is 2500")
    estimate = SimpleNamespace(converged=False, diagnostics={})
    doubted = SimpleNamespace(name="mine", estimates=[estimate])
    assert "in order: ranges look like mm" in log_words.distrust(doubted, footage, [])  # type: ignore[arg-type]


def test_a_strict_run_that_nobody_trusts_ends_with_its_own_status(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def untrusted() -> None:
        raise log_words.UntrustedRunError("mine did not trust 40% of its scans")

    monkeypatch.setattr(cli, "app", untrusted)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == log_words.UNTRUSTED_STATUS == 6
