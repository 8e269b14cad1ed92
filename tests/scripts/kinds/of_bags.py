# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 1 and 2, as killed recorders, clocks and drivers leave them."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tests.slam.logs.foreign_bags as bags
from slam.frames import Frame
from tests.scripts.kinds.kind import Kind, read_log
from tests.slam.logs.test_bags_as_found import with_wal

N, STEP_NS, S, SPEED = 40, 100_000_000, 1_000_000_000, 0.1
MAKE = bags.Maker()
OF_ANOTHER = "… scans outside the odometry's time, or with another's time or frame, left out"
LOST = "… messages missing that the recording says it has"


def _time(k: int) -> int:
    return bags.START_NS + STEP_NS * k


def _near(k: int) -> float:
    """What all beams of scan k say, m."""
    return 2.0 + 0.01 * k


def _messages(
    scan: Callable[[int], dict[str, Any]] = lambda _: {},
    speed: float = SPEED,
    make: bags.Maker = MAKE,
) -> list[bags.Message]:
    """Odometry and scans by turns; ``scan`` changes fields of scan k."""
    out = []
    for k in range(N):
        out.append(make.odometry(_time(k), (speed * k, 0.0, 0.0)))
        out.append(make.scan(_time(k), **{"ranges": [_near(k)] * 9, **scan(k)}))
    return out


def _bag(folder: Path, **how: Any) -> Path:
    return bags.write_ros2(folder / "a", _messages(**how))


def _no_odometry(folder: Path) -> Path:
    return bags.write_ros2(folder / "a", [m for m in _messages() if m[0] == "/scan"])


def _ends_early(folder: Path) -> Path:
    """Odometry up to the middle."""
    rows = [m for m in _messages() if m[0] == "/scan" or m[2] < _time(N // 2)]
    return bags.write_ros2(folder / "a", rows)


def _late(folder: Path) -> Path:
    """Odometry is logged after all scans."""
    late = [(t, kind, ns + (t == "/odom") * N * STEP_NS, m) for t, kind, ns, m in _messages()]
    return bags.write_ros2(folder / "a", sorted(late, key=lambda m: m[2]))


def _stamped(stamp_ns: Callable[[int], int]) -> Callable[[Path], Path]:
    """Scan k is logged in its time, and has this stamp."""
    return partial(_bag, scan=lambda k: {"header": MAKE.header(stamp_ns(k), "laser")})


def _cut(folder: Path) -> Path:
    """The first three quarters of each kind of file."""
    (folder / "cut").mkdir()
    ros1 = bags.write_ros1(folder / "a.bag", _messages(make=bags.Maker(ros1=True)))
    wholes = {"a.bag": ros1, "a.bag.active": ros1}
    for storage, end in (("sqlite3", ".db3"), ("mcap", ".mcap")):
        whole = bags.write_ros2(folder / storage, _messages(), storage)
        wholes[f"a{end}"] = whole / f"{storage}{end}"
    for name, whole in wholes.items():
        data = whole.read_bytes()
        (folder / "cut" / name).write_bytes(data[: len(data) * 3 // 4])
    return folder / "cut"


def _read_cut(folder: Path, strict: bool) -> tuple[str, list[list[Frame]]]:
    return "", [read_log(path, strict)[1] for path in sorted(folder.iterdir())]


def _up_to_the_cut(logs: Sequence[Sequence[Any]]) -> None:
    assert len(logs) == 4
    for frames in logs:
        assert N // 3 < len(frames) < N
        _read(frames, range(len(frames)))


def _wal(folder: Path, **how: bool) -> Path:
    path = _bag(folder)
    with_wal(path, **how)
    return path


def _other_metadata(folder: Path) -> Path:
    page = _bag(folder) / "metadata.yaml"
    text = page.read_text()
    for old, new in (
        ("offered_qos_profiles: []", "offered_qos_profiles: [{history: best, depth: x}]"),
        ("type_description_hash: ", "type_description_hash: RIHS01_0"),
    ):
        assert old in text
        text = text.replace(old, new)
    page.write_text(text)
    return page.parent


def _read(frames: Sequence[Any], kept: Iterable[int] = range(N)) -> None:
    """These scans, in their order, each with the odometry of its time."""
    ways = [float(frame.odometry.T_odom_robot[0]) for frame in frames]
    np.testing.assert_allclose(ways, [SPEED * k for k in kept], atol=1e-9)
    _scans(frames, kept)


def _scans(frames: Sequence[Any], kept: Iterable[int] = range(N)) -> None:
    for frame, k in zip(frames, kept, strict=True):
        assert frame.scan.ranges.tolist() == [np.float32(_near(k))] * 9


def _half(frames: Sequence[Any]) -> None:
    """Those that are not lost: N messages of 2 N."""
    assert abs(len(frames) - N // 2) <= 1


def _torn(k: int) -> dict[str, Any]:
    few = {3: 0, 7: 1, 8: 4}.get(k, 9)
    return {"ranges": [_near(k)] * few, "angle_increment": 0.25}


def _without_returns(frames: Sequence[Any]) -> None:
    want = [2.0] * 6 + [np.inf] * 3
    assert all(frame.scan.ranges.tolist() == want for frame in frames)


def _own_beams(frames: Sequence[Any]) -> None:
    assert [len(frame.scan.ranges) for frame in frames] == [9 - k % 3 for k in range(N)]


def _kind(
    name: str, done: str, said: str, write: Callable[[Path], Path], check: Any = _read,
    read: Any = read_log, strict: bool = True,
) -> Kind:  # fmt: skip
    return Kind(name=name, done=done, said=said, write=write, check=check, read=read, strict=strict)


KINDS = [
    _kind(
        "no odometry",
        "each SLAM gets that of its own last motion (constant velocity), with a covariance "
        "that says how little that is",
        "no odometry: … scans with that of a constant velocity", _no_odometry, _scans,
    ),
    _kind(
        "odometry that stands still while scans move", "it is none, as above",
        "odometry that stands still while scans move taken as none (… messages)",
        partial(_bag, speed=0.0), _scans,
    ),
    _kind(
        "a bag without an end, of a recorder that was killed "
        "(`.mcap`, `.db3`, `.bag`, `.bag.active`)",
        "it is read up to the cut",
        "1 files without an end, of a recorder that was killed, read up to the cut",
        _cut, _up_to_the_cut, _read_cut,
    ),
    _kind(
        "messages of `metadata.yaml` that are in no file", "what is there is read", LOST,
        partial(_wal, keep=False), _half,
    ),
    _kind(
        "a `-wal` that SQLite cannot read", "what is in the `.db3` is read", LOST,
        partial(_wal, spoil=True), _half,
    ),
    _kind("messages that SQLite left in `-wal`", "read, too", "", _wal, strict=False),
    _kind(
        "`metadata.yaml`: QoS or type hashes of another ROS", "they hide no message", "",
        _other_metadata, strict=False,
    ),
    _kind(
        "scans without beams, or of less than half of the usual number and field of view",
        "they are left out", "… scans without beams, or of less than half of them, left out",
        partial(_bag, scan=_torn), partial(_read, kept=[k for k in range(N) if k not in (3, 7, 8)]),
    ),
    _kind(
        "scans that differ in beams, angles or `range_max`",
        "each is read by its own header, but for `range_min` and the times of beams: those are of "
        "the first scan with these beams and angles",
        "scans differ, each is read by its own header: 7 to 9 beams, …",
        partial(_bag, scan=lambda k: {"ranges": [2.0] * (9 - k % 3)}), _own_beams, strict=False,
    ),
    _kind(
        "ranges exactly at `range_max`, more than 0.5 % of all and more than those just below",
        "they are no returns", "… returns in a mass exactly at range_max read as none",
        partial(_bag, scan=lambda _: {"ranges": [2.0] * 6 + [30.0] * 3}), _without_returns,
    ),
    _kind(
        "scans outside the time of the odometry", "they are left out", OF_ANOTHER,
        _ends_early, partial(_read, kept=range(N // 2)),
    ),
    _kind(
        "scans with the stamp of another", "the first of them is read", OF_ANOTHER,
        _stamped(lambda k: _time(k - (k == 20))),
        partial(_read, kept=[k for k in range(N) if k != 20]),
    ),
    _kind(
        "stamps of a topic that never change", "its times are those of the bag's log",
        "… scans with the time of another spread over the time there was",
        _stamped(lambda _: bags.START_NS),
    ),
    _kind(
        "odometry that was logged late",
        "it is matched by its stamps", "", _late, strict=False,
    ),
    _kind(
        "scans and odometry without a time in common", "refused",
        "scans are of 1 to 4.9 s, odometry is of … to … s; where one has simulated time",
        _stamped(lambda k: S + STEP_NS * k), None, strict=False,
    ),
]  # fmt: skip
