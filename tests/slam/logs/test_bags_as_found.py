# SPDX-License-Identifier: Apache-2.0
"""Bags as public reports describe them: read to the centimetre, with a warning, or refused."""

import math
import sqlite3
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
from slam import create, se2
from slam.errors import InvalidValueError, LogFormatError
from slam.evaluation.scanner.card import measure
from slam.logs import open_log, read_bag
from slam.replay import Replay
from tests.world2d import Drive, World2D, arena, frames, laser

START, MS, S = bags.START_NS, 1_000_000, 1_000_000_000
RATE_HZ, SCANS = 20, 120
STEP = math.pi / 180.0
DRIVE = Drive((-1.0, -1.5, 0.0), ((0.6, 0.5, 2.5), (0.6, -0.4, 1.5), (0.4, 0.8, 3.0)))
T_ROBOT_LASER = laser(181).T_robot_laser


@pytest.fixture(scope="module")
def driven() -> list[Any]:
    """Frames of a drive in the arena."""
    made = list(frames(World2D(arena()), DRIVE, rate_hz=float(RATE_HZ), spec=laser(181), seed=3))
    return made[:SCANS]


def recorded(driven, change=lambda k, scan: scan, ros1=False, odometry=lambda k, pose: pose):
    """Messages of a bag; ``change`` of a scan's ranges and fields, ``odometry`` of a pose."""
    make = bags.Maker(ros1=ros1)
    place = (float(T_ROBOT_LASER[0]), float(T_ROBOT_LASER[1]), 0.0)
    out = [make.transform(START, "base_link", "laser", place, (0.0, 0.0, 0.0, 1.0))]
    for k, frame in enumerate(driven):
        ns = START + frame.stamp_ns
        scan = {"ranges": frame.scan.ranges, "angle_min": -90 * STEP, "angle_increment": STEP}
        out.append(make.odometry(ns, odometry(k, frame.odometry.T_odom_robot)))
        fields = change(k, {**scan, "range_max": 80.0})
        out.append(make.scan(ns, **{**fields, "ranges": np.ascontiguousarray(fields["ranges"])}))
    return out


def error_m(path: Path, driven, **options: Any) -> tuple[float, int]:
    """Root mean square error of ``shunting`` in the frame of its first pose, and how many scans."""
    replay = Replay.of({"shunting": create("shunting")})
    count = sum(1 for _ in replay.run(read_bag(path, **options)))
    track = replay.tracks["shunting"].online()
    true = {START + frame.stamp_ns: frame.truth for frame in driven}
    first = true[int(track.stamps_ns[0])]
    wanted = [se2.between(first, true[int(ns)])[:2] for ns in track.stamps_ns]
    apart = track.poses[:, :2] - np.array(wanted)
    return float(np.sqrt((apart * apart).sum(axis=1).mean())), count


def poses_of(path: Path, **options: Any) -> np.ndarray:
    return np.array([frame.odometry.T_odom_robot for frame in read_bag(path, **options)])


def fewer_beams(k, scan):
    return {**scan, "ranges": scan["ranges"][: 181 - k % 6]}


def other_start(k, scan):
    left = k % 3
    return {**scan, "ranges": scan["ranges"][left:], "angle_min": (left - 90) * STEP}


def every_other(k, scan):
    return {**scan, "ranges": scan["ranges"][::2], "angle_increment": 2 * STEP} if k % 2 else scan


def farthest(k, scan):
    return {**scan, "range_max": float(np.float32(scan["ranges"].max()))}


def clockwise(k, scan):
    ranges = scan["ranges"][: 181 - k % 4][::-1]
    return {**scan, "ranges": ranges, "angle_min": (len(ranges) - 91) * STEP,
            "angle_increment": -STEP}  # fmt: skip


@pytest.mark.parametrize("change", [fewer_beams, other_start, every_other, farthest, clockwise])
def test_each_scan_is_read_by_its_own_header(tmp_path, driven, change, caplog):
    path = bags.write_ros2(tmp_path / "a", recorded(driven, change))
    error, count = error_m(path, driven, strict=True)
    assert error < 0.02
    assert count == SCANS
    assert [r for r in caplog.records if "each is read by its own header" in r.getMessage()]


def test_what_needs_one_geometry_says_so(tmp_path, driven):
    stream = read_bag(bags.write_ros2(tmp_path / "a", recorded(driven, fewer_beams)))
    with pytest.raises(InvalidValueError, match="one number of beams, got 181 and 180"):
        measure(stream)


@pytest.mark.parametrize("still", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0), (1e9, 0.0, 0.0)])
def test_odometry_that_stands_still_is_none(tmp_path, driven, still, caplog):
    path = bags.write_ros2(tmp_path / "a", recorded(driven, odometry=lambda k, pose: still))
    stream = read_bag(path)
    assert not stream.metadata.odometry
    assert "stands still while scans move" in caplog.text
    assert error_m(path, driven)[0] < 0.02
    with pytest.raises(LogFormatError, match="/odom: the odometry stands still"):
        read_bag(path, strict=True)


def test_odometry_of_a_robot_that_stands_is_believed(tmp_path, driven):
    at_rest = recorded([driven[0]] * 2, odometry=lambda k, pose: (0.0, 0.0, 0.0))
    parked = [(*m[:2], m[2] + k * S, m[3]) for k, m in enumerate(at_rest)]
    assert read_bag(bags.write_ros2(tmp_path / "a", parked)).metadata.odometry


@pytest.mark.parametrize(("most", "limit"), [(80.0, 3.5), (65.535, 5.0), (6.0, 4.5)])
def test_a_mass_of_returns_at_range_max_is_none(tmp_path, driven, most, limit, caplog):
    def change(k, scan):
        ranges = np.where(scan["ranges"] > limit, np.float32(most), scan["ranges"])
        return {**scan, "ranges": ranges, "range_max": most}

    path = bags.write_ros2(tmp_path / "a", recorded(driven, change))
    for frame, true in zip(read_bag(path), driven, strict=True):
        wanted = np.where(true.scan.ranges > limit, np.inf, true.scan.ranges)
        np.testing.assert_array_equal(frame.scan.ranges, wanted)
    assert "exactly at range_max read as none" in caplog.text
    with pytest.raises(LogFormatError, match="ranges exactly at range_max, as of no return"):
        read_bag(path, strict=True)


def test_a_far_wall_at_range_max_stays_one(tmp_path, driven):
    path = bags.write_ros2(tmp_path / "a", recorded(driven, farthest))
    assert all(np.isfinite(frame.scan.ranges).all() for frame in read_bag(path))


def with_wal(path: Path, keep: bool = True, spoil: bool = False) -> Path:
    """Half of the messages of a bag are in its write-ahead log only, as of a killed recorder."""
    (file,) = path.glob("*.db3")
    database = sqlite3.connect(file)
    rows = database.execute("SELECT * FROM messages ORDER BY id").fetchall()
    database.execute("DELETE FROM messages")
    database.commit()
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    for part in (rows[: len(rows) // 2], rows[len(rows) // 2 :]):
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", part)
        database.commit()
    wal = Path(f"{file}-wal")
    main, log = file.read_bytes(), bytearray(wal.read_bytes())
    database.close()
    file.write_bytes(main)
    if spoil:
        log[:64] = bytes(64)
    if keep:
        wal.write_bytes(log)
    return file


def test_what_sqlite_left_in_its_log_is_read_and_nothing_is_written(tmp_path, driven):
    path = bags.write_ros2(tmp_path / "a", recorded(driven))
    file = with_wal(path)
    before = {p.name: p.read_bytes() for p in path.iterdir()}
    assert len(poses_of(path, strict=True)) == SCANS == len(poses_of(file, strict=True))
    assert {p.name: p.read_bytes() for p in path.iterdir()} == before


def test_files_of_a_bag_are_read_in_the_order_of_their_numbers(tmp_path, driven):
    messages = recorded(driven)
    for number in (2, 10):
        part = messages[: len(messages) // 2] if number == 2 else messages[len(messages) // 2 :]
        made = bags.write_ros2(tmp_path / f"bag_{number}", part)
        (tmp_path / "bag").mkdir(exist_ok=True)
        (made / f"bag_{number}.db3").rename(tmp_path / "bag" / f"bag_{number}.db3")
    assert len(poses_of(tmp_path / "bag")) == SCANS
    with pytest.raises(LogFormatError, match=r"no metadata\.yaml: its recorder was killed"):
        open_log(tmp_path / "bag", strict=True)


def whole_bag(folder: Path, driven, kind: str) -> Path:
    if kind == "ros1":
        return bags.write_ros1(folder / "a.bag", recorded(driven, ros1=True))
    made = bags.write_ros2(folder / "a", recorded(driven), kind)
    return next(p for p in made.iterdir() if p.suffix != ".yaml")


def test_a_bag_of_ros_1_that_was_never_indexed_is_read(tmp_path, driven):
    whole = whole_bag(tmp_path, driven, "ros1")
    data = bytearray(whole.read_bytes())
    at = data.index(b"index_pos=") + 10
    data[at : at + 8] = bytes(8)
    (tmp_path / "b.bag").write_bytes(data)
    np.testing.assert_array_equal(poses_of(tmp_path / "b.bag"), poses_of(whole))


def restamped(messages, shift_ns, *, scans_only: bool, logged: bool):
    """From the middle on, clocks are ``shift_ns`` further back."""
    out = []
    for k, (topic, kind, ns, message) in enumerate(messages):
        back = shift_ns if k > len(messages) // 2 else 0
        if topic == "/scan" or (not scans_only and topic == "/odom"):
            now = ns - back
            message.header.stamp.sec, message.header.stamp.nanosec = now // S, now % S
        out.append((topic, kind, ns - back if logged else ns, message))
    return out


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "ros1"])
@pytest.mark.parametrize(("scans_only", "logged"), [(True, False), (False, False), (False, True)])
def test_a_clock_that_steps_back_keeps_the_order_of_the_file(
    tmp_path, driven, kind, scans_only, logged, caplog
):
    messages = restamped(
        recorded(driven, ros1=kind == "ros1"), 3 * S, scans_only=scans_only, logged=logged
    )
    if kind == "ros1":
        path = bags.write_ros1(tmp_path / "a.bag", messages)
    else:
        path = bags.write_ros2(tmp_path / "a", messages, kind)
    wanted = np.array([frame.odometry.T_odom_robot for frame in driven])
    np.testing.assert_allclose(poses_of(path), wanted, atol=1e-6)
    assert "times the clock steps back by 1 s or more" in caplog.text
    with pytest.raises(LogFormatError, match=r"topic /\w+: time steps back by"):
        read_bag(path, strict=True)


def test_a_text_log_whose_odometry_stands_still(tmp_path, carmen_text, driven, caplog):
    rows = []
    for k, frame in enumerate(driven):
        ranges = carmen_text.words(frame.scan.ranges)
        rows.append(carmen_text.flaser(k, 0.05 * k, [0, 0, 0], [0, 0, 0], text=ranges))
    (tmp_path / "a.log").write_text("".join(rows))
    assert not open_log(tmp_path / "a.log").metadata.odometry
    assert "stands still while scans move" in caplog.text
    with pytest.raises(LogFormatError, match="stands still"):
        open_log(tmp_path / "a.log", strict=True)


ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"


def test_a_recording_that_is_a_link_out_of_its_folder_is_refused(tmp_path, driven):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").symlink_to(whole_bag(tmp_path, driven, "mcap"))
    with pytest.raises(LogFormatError, match="a link out of its folder"):
        read_bag(tmp_path / "bag")


@pytest.mark.parametrize(
    "made",
    [
        f"VIEW messages AS {ENDLESS} SELECT x id, 1 topic_id, x timestamp, x'00' data FROM c",
        "TABLE messages(id INTEGER, topic_id, timestamp, data AS (zeroblob(900000000)))",
    ],
)
def test_sqlite_that_computes_its_messages_is_refused(tmp_path, driven, made):
    bag = bags.write_ros2(tmp_path / "a", recorded(driven[:5]))
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("ALTER TABLE messages RENAME TO kept")
        database.execute(f"CREATE {made}")
    with pytest.raises(LogFormatError, match="messages is not a table of messages, but computed"):
        read_bag(bag)


def test_metadata_whose_keys_merge_without_end_is_none(tmp_path, driven):
    bag = bags.write_ros2(tmp_path / "a", recorded(driven[:5]))
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{k}: &a{k} {{<<: [{', '.join([f'*a{k - 1}'] * 10)}]}}" for k in range(1, 12)]
    (bag / "metadata.yaml").write_text("\n".join(lines))
    assert len(list(read_bag(bag))) == 5


def test_a_chunk_in_a_chunk_is_refused(tmp_path):
    def record(kind: int, data: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(data)) + data

    body = record(5, bytes(22))
    for _ in range(2):
        head = struct.pack("<QQQIIQ", 0, 0, len(body), 0, 0, len(body))
        body = record(6, head + body)
    file = tmp_path / "a.mcap"
    file.write_bytes(b"\x89MCAP0\r\n" + record(1, b"\4\0\0\0ros2" + bytes(4)) + body + b"\x05")
    with pytest.raises(LogFormatError, match="a chunk in a chunk"):
        read_bag(file)
