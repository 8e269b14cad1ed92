# SPDX-License-Identifier: Apache-2.0
"""A recorded episode is what was seen live, for our reader and for those of others."""

import math
import struct
import tracemalloc
import zlib
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from scenes.kinds import kind_of
from sim.moments import Moment
from sim.recording.bag import BagWriter
from sim.recording.tables import pairs
from sim.sensors.lidar.models.lms221 import Lms221Config
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, BeamClass, Frame, LaserSpec, Odometry, Scan
from slam.laser_scan import turns_of
from slam.logs import read_bag
from slam.maps import read_map
from slam.ros.template import EPOCH_NS
from slam.trajectory import read_tum

pytestmark = pytest.mark.slow
CUBE, CYLINDER = 1, 3  # of visualization_msgs/Marker


@pytest.fixture(scope="session")
def decoded(recorded) -> dict[str, list[Any]]:
    """Every message by topic, as the MCAP library of others decodes it."""
    out: dict[str, list[Any]] = defaultdict(list)
    with next(recorded.path.glob("*.mcap")).open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, message, ros in reader.iter_decoded_messages():
            out[channel.topic].append((schema.name, message.log_time, ros))
    return out


def checked(path: Path) -> None:
    """Every CRC of the file by those who read it; the summary's, which they leave, by the spec."""
    with path.open("rb") as file:
        list(StreamReader(file, validate_crcs=True).records)
    data = path.read_bytes()
    start, _, crc = struct.unpack("<QQI", data[-28:-8])  # the footer, then eight bytes of magic
    if zlib.crc32(data[start:-12]) != crc:
        raise ValueError("of the summary")


def test_every_crc_is_there_and_right(recorded):
    path = next(recorded.path.glob("*.mcap"))
    checked(path)
    with path.open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    crcs = [r.uncompressed_crc for r in records if isinstance(r, Chunk)]
    crcs += [r.data_section_crc for r in records if isinstance(r, DataEnd)]
    crcs += [r.summary_crc for r in records if isinstance(r, Footer)]
    assert len(crcs) == len(set(crcs)) >= 4
    assert 0 not in crcs


def in_a_bag(frame: Frame) -> Frame:
    """As a bag has it: a LaserScan message does not state the sigma of its ranges."""
    if frame.scan is None:
        return frame
    spec = replace(frame.scan.spec, range_sigma_m=0.0)
    return replace(frame, scan=replace(frame.scan, spec=spec))


def test_frames_read_back_are_those_seen_live(recorded):
    stream = read_bag(recorded.path, labels=True)
    live = [in_a_bag(moment.frame) for moment in recorded.moments]
    assert list(stream) == live
    assert list(stream) == live  # and again
    assert stream.metadata.laser == replace(recorded.simulation.spec, range_sigma_m=0.0)
    without = next(iter(read_bag(recorded.path)))
    assert without.labels is None
    assert without.truth is not None


@pytest.mark.parametrize("resolution_deg", [1.0, 0.5, 0.25])
@pytest.mark.parametrize("fov_deg", [100, 180])
@pytest.mark.parametrize("range_mode", ["8m", "80m"])
def test_every_setting_of_the_scanner_is_rebuilt_exactly(
    tmp_path, resolution_deg, fov_deg, range_mode
):
    config = Lms221Config.ideal(
        resolution_deg=resolution_deg, fov_deg=fov_deg, range_mode=range_mode
    )
    spec = config.spec(np.array([0.02, 0.0, 0.0]))
    assert turns_of(spec) == config.turns
    frames = [plain_frame(spec, k * 53_333_333) for k in range(3)]
    write(tmp_path / "bag", spec, frames)
    stream = read_bag(tmp_path / "bag")
    assert stream.metadata.laser == spec
    assert list(stream) == frames


def plain_frame(spec: LaserSpec, stamp_ns: int, intensities: bool = False) -> Frame:
    ranges = np.linspace(1.0, 7.0, spec.n_beams, dtype=np.float32)
    scan = Scan(
        stamp_ns=stamp_ns,
        ranges=ranges,
        spec=spec,
        intensities=ranges if intensities else None,
    )
    pose = np.array([stamp_ns * 1e-9, 0.1, 0.3])
    return Frame(
        stamp_ns=stamp_ns, odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=pose), scan=scan
    )


def write(path: Path, spec: LaserSpec, frames: list[Frame], **options: Any) -> BagWriter:
    nobody = (np.zeros((0, 3)), np.zeros(0, dtype=np.bool_))
    with BagWriter(path, spec, labels=False, **options) as bag:
        for frame in frames:
            bag.write(Moment(frame=frame, poses=nobody[0], moving=nobody[1]))
    return bag


def test_intensities_and_frames_without_truth_survive(tmp_path):
    spec = Lms221Config().spec()
    frames = [plain_frame(spec, k * 26_666_667, intensities=True) for k in range(3)]
    write(tmp_path / "bag", spec, frames, intensities=True)
    assert list(read_bag(tmp_path / "bag")) == [in_a_bag(f) for f in frames]


def test_topics_are_standard_messages(decoded, recorded):
    n = len(recorded.moments)
    counts = {topic: (found[0][0], len(found)) for topic, found in decoded.items()}
    assert counts == {
        "/scan": ("sensor_msgs/msg/LaserScan", n),
        "/scan_turn": ("sensor_msgs/msg/LaserScan", 2 * n),
        "/odom": ("nav_msgs/msg/Odometry", n),
        "/odom_increment": ("geometry_msgs/msg/PoseWithCovarianceStamped", n),
        "/tf": ("tf2_msgs/msg/TFMessage", n),
        "/tf_static": ("tf2_msgs/msg/TFMessage", 1),
        "/clock": ("rosgraph_msgs/msg/Clock", n),
        "/map": ("nav_msgs/msg/OccupancyGrid", 1),
        "/initialpose": ("geometry_msgs/msg/PoseWithCovarianceStamped", 1),
        "/ground_truth/time": ("sensor_msgs/msg/TimeReference", 1),
        "/ground_truth/tf": ("tf2_msgs/msg/TFMessage", n),
        "/ground_truth/pose": ("geometry_msgs/msg/PoseStamped", n),
        "/ground_truth/objects": ("visualization_msgs/msg/MarkerArray", n),
        "/ground_truth/labels": ("sensor_msgs/msg/PointCloud2", n),
    }


def test_scans_follow_rep_117_and_the_driver(decoded, recorded):
    scan, turn = decoded["/scan"][0][2], decoded["/scan_turn"][1][2]
    assert scan.header.frame_id == turn.header.frame_id == "laser"
    assert scan.scan_time == pytest.approx(2 / 75)
    assert turn.scan_time == pytest.approx(1 / 75)
    assert turn.time_increment == pytest.approx(turn.scan_time / math.tau * math.radians(1.0))
    for message in (scan, turn):
        beams = len(message.ranges) - 1
        assert message.angle_max == pytest.approx(
            message.angle_min + beams * message.angle_increment, abs=1e-5
        )
    spec = recorded.simulation.spec
    stamp = turn.header.stamp.sec * NS_PER_S + turn.header.stamp.nanosec
    first = recorded.moments[0].frame.stamp_ns
    assert stamp - EPOCH_NS - first == round(spec.beam_time_offsets[1] * 1e9)
    for k, moment in enumerate(recorded.moments):
        ranges = np.array(decoded["/scan"][k][2].ranges, dtype=np.float32)
        assert np.array_equal(ranges, moment.frame.scan.ranges, equal_nan=True)
        assert not np.isneginf(ranges).any()
    every = np.concatenate([m.frame.scan.ranges for m in recorded.moments])
    assert np.isnan(every).any()  # the codes are really there


def test_objects_stand_where_they_truly_are(decoded, recorded):
    movers = recorded.simulation.world.scene.movers
    moved = 0
    for (_, stamp, array), moment in zip(
        decoded["/ground_truth/objects"], recorded.moments, strict=True
    ):
        assert stamp == moment.frame.stamp_ns + EPOCH_NS
        assert len(array.markers) == len(movers) - 1
        for marker in array.markers:
            mover = movers[marker.id]
            assert (marker.ns, marker.text) == (mover.kind, mover.name)
            x, y, yaw = moment.poses[marker.id]
            if mover.kind == "door":
                continue
            half = kind_of(mover.kind).half_length_m
            assert (marker.pose.position.x, marker.pose.position.y) == (x, y)
            assert marker.scale.x == pytest.approx(2.0 * (mover.radius + half))
            assert marker.type == (CUBE if half > 0.0 else CYLINDER)
            q = marker.pose.orientation
            assert abs(se2.wrap(2.0 * math.atan2(q.z, q.w) - yaw)) < 1e-12
            moved += (marker.color.r > 0.8) and bool(moment.moving[marker.id])
            assert (marker.color.r > 0.8) == bool(moment.moving[marker.id])
    assert moved > 0


def test_labels_lie_on_the_points_that_they_label(decoded, recorded):
    kinds = set()
    for (_, _, cloud), moment in zip(
        decoded["/ground_truth/labels"], recorded.moments, strict=True
    ):
        dtype = np.dtype(
            {
                "names": [f.name for f in cloud.fields],
                "formats": [{7: "<f4", 5: "<i4", 2: "u1"}[f.datatype] for f in cloud.fields],
                "offsets": [f.offset for f in cloud.fields],
                "itemsize": cloud.point_step,
            }
        )
        points = np.frombuffer(bytes(cloud.data), dtype=dtype)
        scan, labels = moment.frame.scan, moment.frame.labels
        there = np.isfinite(scan.ranges)
        assert np.array_equal(np.isfinite(points["x"]), there)
        distance = np.hypot(points["x"], points["y"])[there]
        assert np.abs(distance - scan.ranges[there]).max() < 2e-3
        assert np.array_equal(points["body"], labels.body)
        assert np.array_equal(points["kind"], labels.kind)
        kinds |= set(points["kind"].tolist())
    assert {int(BeamClass.STATIC), int(BeamClass.MOVING)} <= kinds


def test_odometry_carries_the_covariance_accumulated_so_far(recorded, decoded):
    covariance, before = np.zeros((3, 3)), None
    for moment, (_, _, message) in zip(recorded.moments, decoded["/odom"], strict=True):
        now = moment.frame.odometry
        step = np.zeros(3) if before is None else se2.between(before, now.T_odom_robot)
        start = now.T_odom_robot if before is None else before
        covariance = se2.propagate(covariance, start, step, now.increment_covariance)
        written = np.reshape(message.pose.covariance, (6, 6))[np.ix_((0, 1, 5), (0, 1, 5))]
        np.testing.assert_allclose(written, covariance, rtol=1e-9, atol=1e-15)
        before = now.T_odom_robot


def test_the_files_beside_the_bag_hold_the_truth(recorded):
    truth = read_tum(recorded.path / "trajectory.tum")
    live = np.array([m.frame.truth for m in recorded.moments])
    np.testing.assert_allclose(truth.poses, live, atol=1e-9)
    raster = read_map(recorded.path / "map.yaml")
    static = recorded.simulation.world.scene.static_map
    assert np.array_equal(raster.values, static.values, equal_nan=True)
    lines = (recorded.path / "relations.txt").read_text().splitlines()
    assert len(lines) == len(pairs(truth)) > 0
    t1, t2, x, y, z, roll, pitch, yaw = map(float, lines[0].split())
    assert min(t1, t2) >= EPOCH_NS // NS_PER_S
    k1, k2 = (int(np.argmin(np.abs(truth.stamps_ns * 1e-9 - t))) for t in (t1, t2))
    np.testing.assert_allclose((x, y, yaw), se2.between(live[k1], live[k2]), atol=1e-8)
    assert (z, roll, pitch) == (0.0, 0.0, 0.0)


def test_memory_stays_flat_however_long_the_episode(tmp_path):
    spec = Lms221Config().spec()

    def peak(n: int) -> tuple[int, int]:
        frames = (plain_frame(spec, k * 26_666_667) for k in range(n))
        path = tmp_path / str(n)
        tracemalloc.start()
        write(path, spec, frames)
        writing = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        for _ in read_bag(path):
            pass
        reading = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return writing, reading

    short, long = peak(200), peak(1000)
    assert long[0] < short[0] + 3_000_000
    assert long[1] < short[1] + 3_000_000


def test_a_frame_of_another_scanner_or_without_a_scan_is_refused(tmp_path):
    spec, other = Lms221Config().spec(), Lms221Config(resolution_deg=1.0).spec()
    with pytest.raises(InvalidValueError, match="another one"):
        write(tmp_path / "bag", spec, [plain_frame(other, 0)])
    assert not list((tmp_path / "bag").glob("metadata.yaml"))
