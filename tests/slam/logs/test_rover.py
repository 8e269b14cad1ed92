# SPDX-License-Identifier: Apache-2.0
"""Text logs read by a description of their columns."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from slam import se2
from slam.errors import LogFormatError
from slam.logs import open_log, read_rover
from slam.logs.rover import read_format

TICKS = """
[time]
column = 1
unit = "us"
[odometry]
left = 3
right = 4
ticks_per_turn = 1000
wheel_radius = 7.7
track = 33.0
unit = "cm"
counter = 65536
[scan]
first = 6
beams = 5
unit = "mm"
start_deg = -60.0
step_deg = 30.0
range_max = 4000
[laser]
x = 145
unit = "mm"
"""
POSES = """
separator = ","
[time]
column = 1
[odometry]
x = 2
y = 3
theta = 4
angle = "deg"
[scan]
first = 5
start_deg = 90
step_deg = -45
range_max = 10.0
"""
RANGES = "1000 2000 0 4000 500"


def write(tmp_path, description, log):
    (tmp_path / "rover.toml").write_text(description)
    (tmp_path / "a.txt").write_text(log)
    return tmp_path / "a.txt", tmp_path / "rover.toml"


def test_encoder_ticks_become_poses(tmp_path):
    """The wheels turn by 100 and 120 ticks a line; the counter of 16 bits starts again at 0."""
    rows = [
        f"{100_000 * k} x {(65_400 + 100 * k) % 65536} {120 * k} y {RANGES}\n" for k in range(4)
    ]
    path, toml = write(tmp_path, TICKS, "# a comment\n\n" + "".join(rows))
    frames = list(open_log(path, text_format=toml))
    per_tick = math.tau * 0.077 / 1000.0
    twist = [110 * per_tick, 0.0, 20 * per_tick / 0.33]
    wanted = [se2.exp(twist, k) for k in range(4)]
    np.testing.assert_allclose([f.odometry.T_odom_robot for f in frames], wanted, atol=1e-9)
    assert [f.stamp_ns for f in frames] == [k * 100_000_000 for k in range(4)]
    scan = frames[0].scan
    np.testing.assert_array_equal(scan.ranges, np.float32([1.0, 2.0, math.nan, math.inf, 0.5]))
    np.testing.assert_allclose(np.degrees(scan.spec.angles), [-60, -30, 0, 30, 60], atol=1e-9)
    np.testing.assert_allclose(scan.spec.T_robot_laser, [0.145, 0.0, 0.0], atol=1e-9)


def test_poses_commas_and_a_clockwise_scanner(tmp_path):
    rows = [f"{0.1 * k},{0.2 * k},-1.0,90,1,2,3,4,5\n" for k in range(3)]
    frames = list(
        open_log(*write(tmp_path, POSES, "".join(rows))[:1], text_format=tmp_path / "rover.toml")
    )
    np.testing.assert_allclose(frames[1].odometry.T_odom_robot, [0.2, -1.0, math.pi / 2])
    np.testing.assert_array_equal(frames[0].scan.ranges, np.float32([5, 4, 3, 2, 1]))
    np.testing.assert_allclose(
        np.degrees(frames[0].scan.spec.angles), [-90, -45, 0, 45, 90], atol=1e-9
    )


def test_without_odometry_it_is_that_of_a_constant_velocity(tmp_path, caplog):
    description = POSES.replace('[odometry]\nx = 2\ny = 3\ntheta = 4\nangle = "deg"\n', "")
    path, toml = write(tmp_path, description, "0,0,0,0,1,2,3\n1,0,0,0,1,2,3\n")
    stream = open_log(path, text_format=toml)
    assert not stream.metadata.odometry
    assert "2 scans with that of a constant velocity" in caplog.text
    with pytest.raises(LogFormatError, match=r"no odometry \(refused by --strict"):
        open_log(path, text_format=toml, strict=True)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("column = 1", "column = 0", r"time.column must be a whole number from 1 .*, got 0"),
        ("column = 1", "kolumns = 1", "time: unknown key 'kolumns'; known: column"),
        ('unit = "us"', 'unit = "hours"', "time.unit must be one of ms, ns, s, us, got 'hours'"),
        ("track = 33.0", "track = 0", "odometry.track must be a number from"),
        ("step_deg = 30.0", "step_deg = 0", "must not be 0"),
        ("range_max = 4000", "", "scan.range_max must be a number .*got nothing"),
        ("[scan]", "[scans]", "unknown key 'scans'; known: time, scan"),
        ("[laser]", "[laser", "is no TOML"),
        ("[time]", 'separator = "ab"\n[time]', "separator must be a word that"),
    ],
)
def test_a_wrong_description_names_its_key(tmp_path, old, new, match):
    assert old in TICKS
    path = tmp_path / "rover.toml"
    path.write_text(TICKS.replace(old, new, 1))
    with pytest.raises(LogFormatError, match=match) as caught:
        read_format(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("row", "match"),
    [
        ("1 x 2 3 y 1 2 3 4", "9 columns; expected 5 ranges from column 6"),
        ("1 x 2 3 y 1 2 -3 4 5", "range in column 8 must be 0 to"),
    ],
)
def test_a_damaged_line_is_named(tmp_path, row, match):
    path, toml = write(tmp_path, TICKS, f"0 x 1 1 y 1 2 3 4 5\n{row}\n")
    with pytest.raises(LogFormatError, match=rf"a\.txt:2: {match}"):
        read_rover(path, toml)


def test_a_file_of_comments_and_a_torn_line(tmp_path):
    path, toml = write(tmp_path, TICKS, "# nothing\n")
    with pytest.raises(LogFormatError, match="no scan found"):
        read_rover(path, toml)
    path.write_text("0 x 1 1 y 1 2 3 4 5\n1 x 2 3 y 1 2")
    stream = read_rover(path, toml)
    assert stream.length == stream.metadata.extra["torn_last_line"] == 1


def test_the_description_in_the_docs_is_one(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "logs.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    (tmp_path / "rover.toml").write_text(block)
    made = read_format(tmp_path / "rover.toml")
    assert (made.scan.first, made.scan.beams, made.odometry.counter) == (25, 682, 65536)


HEADS = ["time,x,y,theta,r0,r1,r2\n", '"t [s]","x","y","yaw",0,1,2\n', "%a,b,c,d,e\ns,m,m,deg,m\n"]


@pytest.mark.parametrize("head", ["", *HEADS, "\ufeff", "\ufeff" + HEADS[0]])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_table_may_name_its_columns(tmp_path, head, end):
    rows = head + "".join(f"{k},{k},0,0, 1.0,2.0,3.0\n" for k in range(3))
    path, how = write(tmp_path, POSES, "")
    path.write_bytes(rows.replace("\n", end).encode())
    stream = read_rover(path, how, strict=True)
    assert [frame.odometry.T_odom_robot[0] for frame in stream] == [0.0, 1.0, 2.0]
    assert sum(stream.metadata.extra["ignored"].values()) == head.strip("\ufeff").count("\n")


def test_cells_without_a_range_are_no_returns(tmp_path):
    cells = ["inf", "+Infinity", "nan", "", "N/A", "null", "-inf", "4.0"]
    path, how = write(tmp_path, POSES, f"0,0,0,0,{','.join(cells)}\n1,0,0,0{',1' * len(cells)}\n")
    found = next(iter(read_rover(path, how))).scan.ranges[::-1]  # counted clockwise
    assert np.isinf(found[:2]).all()
    assert np.isnan(found[2:7]).all()
    assert found[7] == 4.0
