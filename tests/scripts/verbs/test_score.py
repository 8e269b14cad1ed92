# SPDX-License-Identifier: Apache-2.0
"""``mobilia score``: what a stack said in a bag, beside the truth of another one."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from sim.moments import Moment
from sim.recording.bag import VERSION, BagWriter
from slam import se2
from slam.ros.messages import MAP, ODOM, PoseMessage, TransformMessage
from slam.ros.recorded import read_statements
from slam.ros.template import EPOCH_NS, STORE
from tests.slam.ros.frames import SPEC, driven

pytestmark = pytest.mark.slow
FRAMES = driven(60)
HOUR_NS = 3600 * 10**9


def written(path: Path, *, truth: bool) -> Path:
    """A bag of ours: scans, perfect odometry, truth or none."""
    with BagWriter(path, SPEC, labels=False) as bag:
        for frame in FRAMES:
            shown = frame if truth else replace(frame, truth=None)
            bag.write(Moment(frame=shown, poses=np.empty((0, 3)), moving=np.empty(0, bool)))
    return path


@pytest.fixture(scope="module")
def ours(tmp_path_factory) -> Path:
    """A bag with truth."""
    return written(tmp_path_factory.mktemp("ours") / "bag", truth=True)


OWN = np.array([1.0, 2.0, 0.5])  # where a stack of its own odometry begins
CHAINS = {  # links of /tf, from what is stated, as (map -> odom, odometry)
    "map -> robot": lambda said, driven: {(MAP, "base_footprint"): se2.compose(said, driven)},
    "its own frame": lambda said, driven: {
        (MAP, "local"): OWN,
        ("local", "base_footprint"): se2.between(OWN, se2.compose(said, driven)),
    },
    "its own, of the same name": lambda said, driven: {
        (MAP, ODOM): OWN,
        (ODOM, "base_footprint"): se2.between(OWN, se2.compose(said, driven)),
    },
    "upside down": lambda said, driven: {(ODOM, MAP): se2.inverse(said)},
    "in two parts": lambda said, driven: {(MAP, "mid"): OWN, ("mid", ODOM): se2.between(OWN, said)},
    "as it should be": lambda said, driven: {
        (MAP, ODOM): said, (ODOM, "base_footprint"): driven
    },
}  # fmt: skip


@pytest.mark.parametrize("name", CHAINS)
def test_whatever_way_leads_to_the_robot_is_followed(called, ours, tmp_path, name):
    edges = list(CHAINS[name](OWN, OWN))
    says = [TransformMessage((*edge, 0.0)) for edge in edges]
    with Writer(tmp_path / "said", version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/tf", says[0].KIND, typestore=STORE)
        for k, frame in enumerate(FRAMES):
            off = np.array([0.001 * k, 0.0, 0.0])
            poses = CHAINS[name](off, frame.odometry.T_odom_robot)
            for say, edge in zip(says, edges, strict=True):
                data = bytes(say(frame.stamp_ns, poses[edge]))
                bag.write(connection, frame.stamp_ns + EPOCH_NS, data)
    ended = called("score", tmp_path / "said", "--on", ours, "--out", tmp_path / "out")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    slams = json.loads((tmp_path / "out" / "results.json").read_text())["slams"]
    assert slams["recorded"]["end_error_m"] == pytest.approx(0.059, abs=1e-3)


def stack(path: Path, offset_ns: int = 0) -> Path:
    """What a stack recorded: its map -> odom goes off by 1 mm a scan."""
    say = TransformMessage((MAP, ODOM, 0.0))
    with Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/tf", say.KIND, typestore=STORE)
        for k, frame in enumerate(FRAMES):
            stamp_ns = frame.stamp_ns + offset_ns
            data = bytes(say(stamp_ns, np.array([0.001 * k, 0.0, 0.0])))
            bag.write(connection, stamp_ns + EPOCH_NS, data)
    return path


def test_a_stack_is_scored_as_a_slam_is(called, ours, tmp_path):
    ended = called("score", stack(tmp_path / "said"), "--on", ours, "--out", tmp_path / "out")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "`recorded` was off by" in ended.stdout
    assert (tmp_path / "out" / "index.html").exists()
    slams = json.loads((tmp_path / "out" / "results.json").read_text())["slams"]
    assert "ms_per_scan_p50" not in slams["recorded"]  # a bag does not say it
    errors = {name: block["end_error_m"] for name, block in slams.items()}
    assert errors["recorded"] == pytest.approx(0.059, abs=1e-3)
    assert errors["odometry"] == pytest.approx(0.0, abs=1e-6)


def test_another_clock_is_named_and_can_be_aligned(called, ours, tmp_path):
    late = stack(tmp_path / "late", HOUR_NS)
    ended = called("score", late, "--on", ours, "--out", tmp_path / "out")
    assert ended.returncode == 1
    assert "--clock-offset -3600" in ended.stdout + ended.stderr
    words = ("--clock-offset", "-3600", "--out", tmp_path / "out")
    assert called("score", late, "--on", ours, *words).returncode == 0


def test_poses_that_cannot_be_are_left_out_and_told_once(ours, tmp_path, caplog):
    say, spread = PoseMessage(MAP), np.diag([0.01, 0.02, 0.03])
    with Writer(tmp_path / "b", version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/amcl_pose", say.KIND, typestore=STORE)
        for k, frame in enumerate(FRAMES):
            data = bytes(say(frame.stamp_ns, np.zeros(3), -spread if k % 3 == 0 else spread))
            bag.write(connection, frame.stamp_ns + EPOCH_NS, data)
    found, poses = read_statements(tmp_path / "b", pose="/amcl_pose")
    assert poses
    assert len(found) == 40
    assert "left out of what was said: 20 messages, the first: " in caplog.text
    assert "topic /amcl_pose, message 1: pose.covariance must be symmetric" in caplog.text


def test_without_truth_what_can_be_said_is_said(called, tmp_path):
    bag = written(tmp_path / "blind", truth=False)
    said = stack(tmp_path / "said")
    ended = called("score", said, "--on", bag, "--out", tmp_path / "out")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "`recorded` ran through 60 scans; without truth, no errors." in ended.stdout


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda said: ("--pose", "/amcl_pose"), "no pose on /amcl_pose"),
        (lambda said: ("--map-frame", "world"), "no world -> odom on /tf; topics: /tf"),
        (lambda said: ("--odom-frame", "local"), "is in the frame 'odom', got 'local'"),
        (lambda said: ("--clock-offset", "nan"), "--clock-offset must be a number from"),
        (lambda said: torn(said), "said: corrupt or truncated bag"),
        (lambda said: ("--on", said), "said: no message of type sensor_msgs/msg/LaserScan"),
    ],
)
def test_wrong_input_is_one_line(called, ours, tmp_path, spoil, says):
    said = stack(tmp_path / "said")
    ended = called("score", said, "--on", ours, *spoil(said), "--out", tmp_path / "out")
    assert ended.returncode in (1, 2)
    assert says in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def torn(bag: Path) -> tuple[()]:
    """Half of it is gone."""
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return ()
