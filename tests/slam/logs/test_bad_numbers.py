# SPDX-License-Identifier: Apache-2.0
"""Whatever number a log has, it ends in frames or in an error: file, line, field, value."""

import math
import re
import struct

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
import tests.slam.logs.mrpt_objects as mrpt
from slam.errors import LogFormatError
from slam.logs import open_log, read_bag
from slam.logs.victoria_graph import read_graph
from tests.slam.logs.conftest import CarmenText
from tests.slam.logs.test_centimetre import lines as centimetre_lines
from tests.slam.logs.test_rover import POSES, RANGES, TICKS

pytestmark = pytest.mark.fuzz
POSE = [0.1, 0.2, 0.3]
TEXT = CarmenText()


def flaser():
    return [TEXT.flaser(k, 1.0 + k, POSE, POSE, n=5) for k in range(4)]


def robotlaser():
    body = "1 -1.0 2.0 0.5 8.0 0.01 0 5 1 2 3 4 5 5 9 9 9 9 9 0.1 0.2 0.3 0.1 0.2 0.3 0 0 0 0 0"
    return [f"ROBOTLASER1 {body} {1.0 + k} host 0\n" for k in range(4)]


def rawlaser():
    rows = []
    for k in range(4):
        rows += [TEXT.odom(k, POSE), f"RAWLASER1 1 -1 2 0.5 8 0.01 0 3 1 2 3 0 {k + 0.5} host 0\n"]
    return [*rows, TEXT.odom(4.0, POSE), "TRUEPOS 0.1 0.2 0.3 0 0 0 1.5 host 0\n"]


def reading():
    return [f"LASER_READING 3 1.0 2.0 3.0 0.1 0.2 0.3 {1.0 + k}\n" for k in range(4)]


def parameters():
    return ["PARAM robot_frontlaser_offset 0.1 host 0\n",
            "PARAM robot_front_laser_max 8.0 host 0\n", *flaser()]  # fmt: skip


def ticks():
    return [f"{100_000 * k} x {100 * k} {120 * k} y {RANGES}\n" for k in range(4)]


def poses():
    return [f"{0.1 * k},{0.2 * k},-1.0,90,1,2,3,4,5\n" for k in range(4)]


def graph():
    edge = "1.0 0.0 0.1 1 0 0 1 0 1"
    return [f"ODOMETRY p0 p1 {edge}\n", "LANDMARK p1 l0 2.0 1.0 0.4 0 0.4\n"]


def made(folder, name, rows):
    """A log of these lines, what is beside it, and what reads it."""
    path = folder / "a.log"
    path.write_text("".join(rows))
    if name in ("ticks", "poses"):
        toml = folder / "a.toml"
        toml.write_text(TICKS if name == "ticks" else POSES)
        return path, lambda: list(open_log(path, text_format=toml))
    return path, lambda: [read_graph(path)] if name == "graph" else list(open_log(path))


ROWS = {
    "flaser": flaser, "robotlaser": robotlaser, "rawlaser": rawlaser, "reading": reading,
    "parameters": parameters, "centimetre": lambda: centimetre_lines(3, 4), "ticks": ticks,
    "poses": poses, "graph": graph,
}  # fmt: skip
PLACES = [  # format, line from 0, word from 0, what the error calls it
    ("flaser", 2, 1, "number of beams"),
    ("flaser", 2, 4, "range 2"),
    ("flaser", 2, 7, "x of the laser"),
    ("flaser", 2, 13, "time"),
    ("robotlaser", 1, 2, "start angle"),
    ("robotlaser", 1, 5, "maximum range"),
    ("robotlaser", 1, 16, "remission 1"),
    ("robotlaser", 1, 31, "time"),
    ("rawlaser", 2, 2, "y of the robot"),
    ("rawlaser", 3, 10, "range 1"),
    ("reading", 1, 3, "range 1"),
    ("reading", 1, 7, "theta of the robot"),
    ("parameters", 0, 2, "PARAM robot_frontlaser_offset"),
    ("centimetre", 1, 2, "y of the robot"),
    ("centimetre", 1, 8, "range 1"),
    ("centimetre", 2, 4, "time"),
    ("ticks", 1, 0, "time: expected a number in column 1"),
    ("ticks", 1, 5, "range: expected a number in column 6"),
    ("poses", 1, 3, "theta: expected a number in column 4"),
    ("graph", 0, 4, "dy"),
    ("graph", 1, 5, "sxx"),
]


@pytest.mark.parametrize("bad", ["nan", "-inf", "1e300", "1e99999", "12..5"])
@pytest.mark.parametrize(("name", "line", "word", "field"), PLACES)
def test_a_number_that_breaks_a_bound_is_named(tmp_path, name, line, word, field, bad):
    if (name, word) == ("ticks", 5) and bad in ("nan", "-inf"):
        pytest.skip("says that there is no range")
    rows = ROWS[name]()
    mark = "," if name == "poses" else " "
    words = rows[line].rstrip("\n").split(mark)
    words[word] = bad
    rows[line] = mark.join(words) + "\n"
    path, read = made(tmp_path, name, rows)
    with pytest.raises(LogFormatError) as caught:
        read()
    message = str(caught.value)
    assert message.startswith(f"{path}:{line + 1}: ")
    assert field in message
    assert f"got '{bad}'" in message


@pytest.mark.parametrize("name", ROWS)
def test_sound_logs_of_these_formats_are_read(tmp_path, name):
    assert made(tmp_path, name, ROWS[name]())[1]()


@pytest.mark.parametrize(
    ("name", "old", "new", "field"),
    [
        ("robotlaser", " -1.0 2.0 0.5 ", " 99.0 2.0 0.5 ", "angle_min"),
        ("robotlaser", " 2.0 0.5 ", " 2.0 1e-9 ", "angle_increment"),
        ("flaser", TEXT.words(POSE), "900.1 0.2 0.3", "T_robot_laser"),
        ("graph", "0.4 0 0.4", "0.4 9 0.4", "sxx, sxy, syy"),
        ("graph", "LANDMARK p1", "LANDMARK p7", "pose p7"),
        ("graph", "ODOMETRY", "\n", "expected ODOMETRY"),
    ],
)
def test_what_only_the_frames_refuse_is_named_too(tmp_path, name, old, new, field):
    rows = [row.replace(old, new, 1) for row in ROWS[name]()]
    path, read = made(tmp_path, name, rows)
    with pytest.raises(
        LogFormatError, match=re.escape(f"{path}:") + rf"\d+: .*{field}.*got|is not"
    ):
        read()


START, MS = 1_400_000_000_000_000_000, 1_000_000


@pytest.mark.parametrize(
    ("number", "bad", "field"),
    [
        (2, mrpt.odometry(START, (math.nan, 0.0, 0.0)), "pose must be finite, got .nan"),
        (2, mrpt.odometry(START, (1e9, 0.0, 0.0)), "pose must lie within"),
        (2, mrpt.scan(START, [1.0] * 5, range_max=math.nan), "up to nan m"),
        (2, mrpt.scan(START, [1.0] * 5, aperture=math.inf), "field of view of inf"),
    ],
)
def test_rawlogs_name_the_object(tmp_path, number, bad, field):
    sound = mrpt.scan(START - MS, [1.0] * 5)
    (tmp_path / "a.rawlog").write_bytes(sound + bad + mrpt.odometry(START + MS, (0, 0, 0)))
    with pytest.raises(LogFormatError, match=rf"a\.rawlog:{number}: .*{field}"):
        open_log(tmp_path / "a.rawlog")


def test_rawlogs_of_a_time_beyond_64_bits_name_the_object(tmp_path):
    late = mrpt.scan(START, [1.0] * 5).replace(mrpt.stamp(START), struct.pack("<Q", 2**63))
    (tmp_path / "a.rawlog").write_bytes(late)
    with pytest.raises(
        LogFormatError, match=r"a\.rawlog:1: stamp: .* 64 bits .*, got 9\.1\d+e\+11"
    ):
        open_log(tmp_path / "a.rawlog")


def messages(make, bad):
    """Two poses, two scans, and what is wrong with the third of both topics."""
    fast, far = (make.odometry(bags.START_NS + k * 100 * MS, (0.0, 0.0, 0.0)) for k in (2, 2))
    fast[3].twist.twist.linear.x = 1e6
    far[3].pose.pose.position.y = 1e300
    unturned = make.odometry(bags.START_NS + 200 * MS, (0.0, 0.0, math.nan))
    scan = make.scan(bags.START_NS + 200 * MS, [1.0] * 5, angle_min=math.nan)
    third = {"twist": fast, "position": far, "orientation": unturned, "scan": scan}[bad]
    out = []
    for k in range(2):
        out.append(make.odometry(bags.START_NS + k * 100 * MS, (0.0, 0.0, 0.0)))
        out.append(make.scan(bags.START_NS + (k * 100 + 50) * MS, [1.0] * 5))
    return [*out, third, make.odometry(bags.START_NS + 300 * MS, (0.0, 0.0, 0.0))]


@pytest.mark.parametrize(
    ("bad", "match"),
    [
        ("twist", r"topic /odom, message 3: twist: expected .*, got \[1000000.0"),
        ("position", r"topic /odom, message 3: pose.position: expected .*, got 0, 1e\+300"),
        ("orientation", "topic /odom, message 3: pose.orientation: expected .*, got 0, 0, nan"),
        ("scan", "topic /scan, message 3: .*angle_min .* must be finite"),
    ],
)
@pytest.mark.parametrize("ros1", [False, True])
def test_bags_name_topic_and_message(tmp_path, ros1, bad, match):
    maker = bags.Maker(ros1)
    path = tmp_path / ("a.bag" if ros1 else "a")
    (bags.write_ros1 if ros1 else bags.write_ros2)(path, messages(maker, bad))
    with pytest.raises(LogFormatError, match=match):
        list(read_bag(path))


def test_bags_whose_mirror_turns_have_no_beams_are_refused(tmp_path):
    make = bags.Maker()
    turn = make.scan(bags.START_NS, np.zeros(0), topic="/scan_turn")
    both = [turn, make.scan(bags.START_NS, [1.0] * 5, angle_increment=0.0),
            make.scan(bags.START_NS + MS, [1.0] * 5)]  # fmt: skip
    path = bags.write_ros2(tmp_path / "a", both)
    with pytest.raises(LogFormatError, match="topic /scan, message 1: "):
        read_bag(path)
