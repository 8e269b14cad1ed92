# SPDX-License-Identifier: Apache-2.0
"""Bags with several of a kind or odometry elsewhere; files that are no log."""

import zipfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

import tests.slam.logs.foreign_bags as bags
from slam.frames import Frame
from slam.logs import read_rover
from tests.scripts.kinds.kind import Kind, read_log
from tests.slam.logs.test_rover import POSES

N, STEP_NS, SPEED = 30, 100_000_000, 0.1
MAKE = bags.Maker()


def _bag(*said: Callable[[int, int], bags.Message]) -> Callable[[Path], Path]:
    """Writes what each says of step k, at ns."""

    def write(folder: Path) -> Path:
        times = [(k, bags.START_NS + k * STEP_NS) for k in range(N)]
        return bags.write_ros2(folder / "a", [one(k, ns) for k, ns in times for one in said])

    return write


def _scan(frame: str = "laser", topic: str = "/scan", m: float = 2.0) -> Any:
    return lambda _, ns: MAKE.scan(ns, [m] * 9, header=MAKE.header(ns, frame), topic=topic)


def _odometry(topic: str = "/odom", speed: float = SPEED, **named: str) -> Any:
    return lambda k, ns: MAKE.odometry(ns, (speed * k, 0.0, 0.0), topic=topic, **named)


def _echoes(_: int, ns: int) -> bags.Message:
    return MAKE.echoes(ns, [[2.0, 2.5]] * 9)


def _driven(frames: Iterable[Frame]) -> None:
    """The scans of 2 m with the odometry that goes ahead."""
    ways = [float(frame.odometry.T_odom_robot[0]) for frame in frames]
    np.testing.assert_allclose(ways, SPEED * np.arange(N), atol=1e-9)
    _first(list(frames))


def _first(frames: Sequence[Frame]) -> None:
    assert [float(frame.scan.ranges[0]) for frame in frames] == [2.0] * N


def _table(folder: Path) -> Path:
    rows = [f"{k},{SPEED * k},0,0,2.0,inf,,nan\n" for k in range(N)]
    (folder / "rover.toml").write_text(POSES.replace("range_max", "beams = 4\nrange_max"))
    (folder / "a.csv").write_text("".join(["time,x,y,theta,r0,r1,r2,r3\n", *rows]))
    return folder / "a.csv"


def _read_table(path: Path, strict: bool) -> tuple[str, list[Frame]]:
    stream = read_rover(path, path.with_name("rover.toml"), strict=strict)
    return ", ".join(f"{n} {what}" for what, n in stream.metadata.extra["ignored"].items()), list(
        stream
    )


def _last(frames: Sequence[Frame]) -> None:
    """Counted clockwise: the first cell is the last beam."""
    want = np.float32([np.nan, np.nan, np.inf, 2.0])
    assert all(np.array_equal(frame.scan.ranges, want, equal_nan=True) for frame in frames)


def _zip(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.bag", "w") as archive:
        archive.writestr("a.bag", b"#ROSBAG V2.0\n")
    return folder / "a.bag"


def _json(folder: Path) -> Path:
    with (folder / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("", "test")
        schema = writer.register_schema("LaserScan", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/scan", "json", schema), 1, b"{}", 1)
        writer.finish()
    return folder / "a.mcap"


KINDS = [
    Kind(
        name="odometry on `/tf` alone",
        done="the way from its frame to the robot's is followed",
        said="odometry: odom -> base_link of /tf",
        write=_bag(
            lambda k, ns: MAKE.moved(ns, "odom", "base_link", (SPEED * k, 0.0, 0.0)), _scan()
        ),
        check=_driven, read=read_log,
    ),
    Kind(
        name="topics of several robots",
        done="scans and odometry of one namespace are read",
        said="/a/scan; …; odometry: /a/odom; passed over (--scan, --odometry): /b/scan, /b/odom",
        write=_bag(
            _odometry("/b/odom", 9.0), _odometry("/b/odom", 9.0), _odometry("/a/odom"),
            _scan(topic="/a/scan"), _scan(topic="/b/scan", m=4.0),
        ),
        check=_driven, read=read_log,
    ),
    Kind(
        name="several scanners on one topic",
        done="that with most scans, of which the first, is read by its `frame_id`",
        said="/scan:front; …; passed over (--scan, --odometry): /scan:rear",
        write=_bag(_odometry(), _scan("front"), _scan("rear", m=4.0)),
        check=_driven, read=read_log,
    ),
    Kind(
        name="`MultiEchoLaserScan`",
        done="the first echo of each beam is its range",
        said="/echoes (first echo of each beam)",
        write=_bag(_echoes, _odometry()),
        check=_first, read=read_log,
    ),
    Kind(
        name="a table with column names, `inf`, `nan` and empty cells",
        done="names are passed over; such cells are no return",
        said="1 lines of column names",
        write=_table, check=_last, read=_read_table,
    ),
    Kind(
        name="a packed bag, whatever its name",
        done="refused",
        said="is packed (zip): unpack it (unzip a.bag) and name what is in it",
        write=_zip, check=None, read=read_log,
    ),
    Kind(
        name="MCAP of ROS 1, JSON or others",
        done="refused",
        said="is an MCAP with messages in json; messages of ROS 2 (cdr, profile ros2) are read",
        write=_json, check=None, read=read_log,
    ),
]  # fmt: skip
