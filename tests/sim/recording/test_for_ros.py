# SPDX-License-Identifier: Apache-2.0
"""What SLAM and navigation stacks of ROS need to run on a bag with their defaults."""

import json
import math
import os
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from scripts import spec
from scripts.metrics.judged import in_first_frame
from scripts.single_run.run import Log, on_log
from scripts.verbs.generate import Generate
from sim.moments import toured
from sim.recording.bag import FORMAT, BagWriter
from sim.recording.recipe import RECIPE
from sim.recording.sums import write_sums
from sim.recording.verify import regenerate
from sim.sensors.lidar.registry import scanner_of
from sim.simulation import Simulation
from slam import create, se2
from slam.errors import OutputError
from slam.evaluation import metrics
from slam.frames import EPOCH, NS_PER_S
from slam.logs import read_bag
from slam.logs.bag_tf import mounting
from slam.ros.template import EPOCH_NS
from slam.trajectory import Trajectory, read_tum, write_tum

pytestmark = pytest.mark.slow
generate = spec.command(Generate)

REPO = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def decoded(recorded) -> dict[str, list[Any]]:
    """Every message by topic with its time in the log."""
    return messages_of(recorded.path)


def messages_of(bag: Path) -> dict[str, list[Any]]:
    out: dict[str, list[Any]] = defaultdict(list)
    with next(bag.glob("*.mcap")).open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, ros in reader.iter_decoded_messages():
            out[channel.topic].append((message.log_time, ros))
    return out


def ns(time: Any) -> int:
    return int(time.sec) * NS_PER_S + int(time.nanosec)


def planar(t: Any) -> np.ndarray:
    q = t.rotation
    return np.array([t.translation.x, t.translation.y, 2.0 * math.atan2(q.z, q.w)])


def test_times_are_those_of_an_epoch_and_the_bag_says_which(decoded, recorded):
    for topic, found in decoded.items():
        for log_ns, message in found:
            assert 0 <= log_ns - EPOCH_NS < 3 * NS_PER_S, topic
            if hasattr(message, "header"):
                assert ns(message.header.stamp) == log_ns, topic
    ((_, began),) = decoded["/ground_truth/time"]
    assert ns(began.header.stamp) - ns(began.time_ref) == EPOCH_NS
    assert read_bag(recorded.path).metadata.extra[EPOCH] == EPOCH_NS
    stamps = [m.frame.stamp_ns for m in recorded.moments]
    assert [ns(m.clock) - EPOCH_NS for _, m in decoded["/clock"]] == stamps
    truth = read_tum(recorded.path / "trajectory.tum")
    assert (truth.stamps_ns - EPOCH_NS).tolist() == stamps


def test_the_frames_are_one_tree_in_which_scan_and_movers_meet(decoded, recorded):
    ((_, static),) = decoded["/tf_static"]
    links = {(t.header.frame_id, t.child_frame_id): t.transform for t in static.transforms}
    assert list(links) == [("base_footprint", "base_link"), ("base_link", "laser")]
    assert planar(links["base_footprint", "base_link"]).tolist() == [0.0, 0.0, 0.0]
    for k, moment in enumerate(recorded.moments):
        moving = [decoded[topic][k][1].transforms for topic in ("/tf", "/ground_truth/tf")]
        assert [(t.header.frame_id, t.child_frame_id) for ts in moving for t in ts] == [
            ("odom", "base_footprint"), ("world", "map"), ("map", "odom"),
            ("world", "base_footprint_truth"),
        ]  # fmt: skip
        (robot,), (on_world, drift, true) = moving
        way = se2.IDENTITY
        for link in (on_world, drift, robot):
            way = se2.compose(way, planar(link.transform))
        np.testing.assert_allclose(way, moment.frame.truth, atol=1e-9)
        np.testing.assert_allclose(planar(true.transform), moment.frame.truth, atol=1e-9)
    children = [link.child_frame_id for ts in (static.transforms, *moving) for link in ts]
    assert len(children) == len(set(children))  # nobody has two parents
    frame = decoded["/odom"][0][1]
    assert (frame.header.frame_id, frame.child_frame_id) == ("odom", "base_footprint")
    assert decoded["/ground_truth/objects"][0][1].markers[0].header.frame_id == "world"


def test_the_map_is_that_of_what_never_moves(decoded, recorded):
    ((_, grid),) = decoded["/map"]
    static = recorded.simulation.world.scene.static_map
    cells = np.array(grid.data, dtype=np.int8).reshape(grid.info.height, grid.info.width)
    assert np.array_equal(cells == -1, np.isnan(static.values))
    assert np.array_equal(cells == 100, static.values == 1.0)
    assert np.array_equal(cells == 0, static.values == 0.0)
    assert grid.info.resolution == pytest.approx(static.resolution_m)
    origin = grid.info.origin.position
    np.testing.assert_allclose((origin.x, origin.y), static.T_map_origin[:2])
    assert grid.header.frame_id == "map"


def test_amcl_is_told_where_the_robot_starts(decoded, recorded):
    ((_, start),) = decoded["/initialpose"]
    assert start.header.frame_id == "map"
    position, q = start.pose.pose.position, start.pose.pose.orientation
    pose = (position.x, position.y, 2.0 * math.atan2(q.z, q.w))
    np.testing.assert_allclose(pose, recorded.moments[0].frame.truth, atol=1e-9)
    assert np.array(start.pose.covariance)[[0, 7, 35]].min() > 0.0


def test_what_is_sent_once_is_there_for_who_comes_late(recorded):
    told = yaml.safe_load((recorded.path / "metadata.yaml").read_text())
    topics = told["rosbag2_bagfile_information"]["topics_with_message_count"]
    latched = set()
    for topic in (one["topic_metadata"] for one in topics):
        profiles = topic["offered_qos_profiles"]
        profiles = yaml.safe_load(profiles) if isinstance(profiles, str) else profiles
        if profiles and profiles[0]["durability"] in (1, "transient_local"):
            latched.add(topic["name"])
    assert latched == {"/map", "/tf_static", "/ground_truth/time"}


@pytest.mark.parametrize(
    "name",
    [
        "lms221", "utm30lx", "rplidar_a1",
        "scanner(fov_deg=180,beams=91,rate_hz=20,sigma_m=0.01,range_min_m=0.3)",
    ],
)  # fmt: skip
def test_range_min_is_the_scanners_own(tmp_path: Path, name: str):
    simulation = Simulation("arena", seed=1, laser=name)
    with BagWriter(tmp_path / "bag", simulation.spec, labels=False) as bag:
        bag.write(next(iter(toured(simulation, 0.3))))
    told = messages_of(tmp_path / "bag")["/scan"][0][1]
    scanner = scanner_of(name).scanner()
    assert told.range_min == pytest.approx(scanner.range_min_m)
    assert told.range_max == pytest.approx(scanner.range_max_m)
    ranges = np.array(told.ranges)
    seen = ranges[np.isfinite(ranges)]
    assert seen.min() >= told.range_min
    assert seen.min() > 0.0


def test_one_more_link_moves_the_laser_by_no_bit():
    def link(x: float, z: float, yaw: float) -> Any:
        from types import SimpleNamespace as Of

        q = Of(x=0.0, y=0.0, z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))
        return Of(translation=Of(x=x, y=0.0, z=z), rotation=q)

    straight = mounting({("a", "l"): link(0.13, 0.36, 0.7)}, "a", "l")
    through = mounting(
        {("a", "b"): link(0.0, 0.0, 0.0), ("b", "l"): link(0.13, 0.36, 0.7)}, "a", "l"
    )
    assert straight is not None
    assert through is not None
    assert straight[0].tobytes() == through[0].tobytes()
    at_origin = mounting({("a", "l"): link(0.0, 0.0, 0.0)}, "a", "l")
    assert at_origin is not None
    assert at_origin[0].tolist() == [0.0, 0.0, 0.0]


def test_a_bag_of_another_format_is_not_called_changed(tmp_path: Path):
    generate(["arena"], tmp_path / "data", seconds=0.2, change=0.0)
    episode = tmp_path / "data" / "arena-d0.5-c0-s0000"
    told = json.loads((episode / RECIPE).read_text())
    assert told["result"].pop("bag_format") == FORMAT
    (episode / RECIPE).write_text(json.dumps(told))
    write_sums(episode)
    found = regenerate(episode)
    assert (found.verdict, found.ok) == ("other world", True)
    assert "its bag is of format 1, this mobilia writes format 2" in found.why
    with pytest.raises(OutputError, match=r"format 1, .*: choose another --out"):
        generate(["arena"], tmp_path / "data", seconds=0.2, change=0.0)


def test_a_run_on_an_episode_has_the_times_of_its_bag(recorded, tmp_path: Path):
    on_log(["odometry"], Log(path=recorded.path), tmp_path / "run", overwrite=False, film=False)
    stamps = read_tum(recorded.path / "trajectory.tum").stamps_ns.tolist()
    for name in ("odometry", "truth"):
        assert read_tum(tmp_path / "run" / f"trajectory_{name}.tum").stamps_ns.tolist() == stamps


def test_the_commands_for_evo_say_what_the_page_says(recorded, tmp_path: Path):
    page = (REPO / "docs" / "datasets.md").read_text()
    commands = re.findall(r"^evo_ape .*$", page, flags=re.MULTILINE)
    frames = [moment.frame for moment in recorded.moments]
    odometry = create("odometry")
    for frame in frames:
        odometry.update(frame)
    estimate = odometry.trajectory()
    truth = Trajectory(stamps_ns=estimate.stamps_ns, poses=np.array([f.truth for f in frames]))
    write_tum(tmp_path / "trajectory_shunting.tum", estimate, EPOCH_NS)
    write_tum(tmp_path / "trajectory_truth.tum", in_first_frame(truth), EPOCH_NS)
    words = {"EP": str(recorded.path), "RUN": str(tmp_path)}
    found = []
    for command in commands:
        program, *rest = re.sub(r"\b(EP|RUN)\b", lambda word: words[word[0]], command).split()
        done = subprocess.run(
            [str(Path(sys.executable).with_name(program)), *rest], capture_output=True, text=True,
            env={**os.environ, "HOME": str(tmp_path)}, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found.append(float(re.search(r"rmse\s+(\S+)", done.stdout)[1]))
    wanted = metrics.ate(estimate, truth).value
    assert len(found) == 3
    assert found == pytest.approx([wanted] * 3, abs=2e-6)
