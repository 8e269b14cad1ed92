# SPDX-License-Identifier: Apache-2.0
"""An export is read back as it was, and what it cannot hold is refused in words."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from scripts import exports, formats
from scripts.spec import command
from scripts.verbs.export import Export
from scripts.verbs.generate import Generate
from slam.errors import InvalidValueError, LogFormatError, MissingDependencyError
from slam.frames import Stream, StreamMetadata
from slam.logs import read_bag, read_carmen
from slam.ros.template import EPOCH_NS
from slam.trajectory import read_tum
from tests.world2d import frame_at, laser

pytestmark = pytest.mark.slow
export = command(Export)


@pytest.fixture(scope="module")
def episode(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("exports") / "data"
    command(Generate)(["arena"], out, seconds=1.5, seed=1)
    return next(out.glob("arena-*"))


def source_of(log, frames) -> exports.Source:
    source = exports.Source(log)
    metadata = StreamMetadata(source="test")
    vars(source)["stream"] = Stream(metadata=metadata, frames=lambda: iter(frames))
    return source


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    frames = [frame_at(k, ranges=np.ones(n), spec=laser(n)) for k, n in enumerate((181, 180))]
    both, one = (source_of(tmp_path / "a.log", some) for some in (frames, frames[:1]))
    with pytest.raises(InvalidValueError, match="npz holds scans of one geometry"):
        exports.write("npz", tmp_path / "a.npz", both)
    assert exports.write("npz", tmp_path / "a.npz", one)[0].exists()
    with pytest.raises(InvalidValueError, match=r"of a bag of ROS 2, .*a\.log is none"):
        exports.write("db3", tmp_path / "a.db3", one)


def test_every_format_has_a_writer_and_names_the_extra_that_it_needs(monkeypatch):
    assert all(callable(getattr(exports, name)) for name in formats.FORMATS if name != "minari")
    for name in ("pyarrow", "minari"):
        monkeypatch.setitem(sys.modules, name, None)
    for name, row in formats.FORMATS.items():
        if row.packages:
            with pytest.raises(MissingDependencyError, match=r"pip install 'mobilia\[data\]'"):
                formats.ready(name, recorded=False)


def test_exports_are_read_back(episode, tmp_path):
    frames = list(read_bag(episode, labels=True))
    export(episode, "tum", tmp_path / "a.tum")
    truth, poses = read_tum(tmp_path / "a_truth.tum"), read_tum(episode / "trajectory.tum").poses
    assert truth.stamps_ns.tolist() == [f.stamp_ns + EPOCH_NS for f in frames]
    np.testing.assert_array_equal(truth.poses, poses)
    np.testing.assert_allclose(poses, [f.truth for f in frames], atol=1e-9)
    assert not (tmp_path / "a.tum").exists()  # of what, its name would not say
    odometry = read_tum(tmp_path / "a_odometry.tum").poses
    np.testing.assert_allclose(odometry, [f.odometry.T_odom_robot for f in frames], atol=1e-9)
    export(episode, "carmen", tmp_path / "a.log.gz")
    back = list(read_carmen(tmp_path / "a.log.gz"))
    for ours, theirs in zip(frames, back, strict=True):
        assert ours.stamp_ns == theirs.stamp_ns
        assert np.array_equal(ours.scan.ranges, theirs.scan.ranges, equal_nan=True)
        assert np.array_equal(ours.odometry.T_odom_robot, theirs.odometry.T_odom_robot)
        assert np.array_equal(ours.truth, theirs.truth)
    export(episode, "npz", tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        assert np.array_equal(arrays["ranges"][3], frames[3].scan.ranges, equal_nan=True)
        assert np.array_equal(arrays["label_kind"][3], frames[3].labels.kind)
        assert np.array_equal(arrays["T_world_robot"][-1], frames[-1].truth)
    dataset = episode.parent
    before = sorted(dataset.rglob("*"))
    export(episode, "carmen", None)
    assert sorted(dataset.rglob("*")) == before  # a file that nothing lists would be foreign there
    (dataset.parent / f"{episode.name}.log.gz").unlink()
    with pytest.raises(LogFormatError, match=f"name one of the recordings in it: {episode.name}"):
        export(dataset, "tum", None)


@pytest.mark.parametrize("to", ["db3", "mcap"])
def test_a_bag_packed_again_has_the_same_messages(episode, tmp_path, to):
    packed, other = tmp_path / f"a.{to}", tmp_path / "b" / "a"  # whatever a file is called
    for path in (packed, other):
        export(episode, to, path)
    assert packed.read_bytes() == other.read_bytes()
    told = []
    for path in (episode, packed):
        with Reader(path) as reader:
            rows = ((t, c.topic, bytes(data), c) for c, t, data in reader.messages())
            ordered = sorted(rows, key=lambda row: row[:3])
            told.append([(*row, c.msgtype, c.msgdef, c.ext) for *row, c in ordered])
    assert told[0] == told[1]
    assert list(read_bag(packed, labels=True)) == list(read_bag(episode, labels=True))


def test_a_type_of_ones_own_goes_with_the_bag(tmp_path):
    told = "float64 wet\nfloat64 dry\n"
    with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/soil", "mine/msg/Soil", msgdef=told, rihs01="RIHS01_0")
        writer.write(topic, 7, bytes(20))
    (lone,) = (tmp_path / "bag").glob("*.mcap")  # which says no hash of its types
    export(lone, "db3", tmp_path / "a.db3")
    with Reader(tmp_path / "a.db3") as reader:
        ((topic, stamp_ns, data),) = reader.messages()
    assert (topic.msgtype, topic.msgdef.data, stamp_ns) == ("mine/msg/Soil", told, 7)
    assert bytes(data) == bytes(20)


def test_parquet_has_a_row_a_scan(episode, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    frames = list(read_bag(episode, labels=True))
    for name in ("a", "b"):
        export(episode, "parquet", tmp_path / f"{name}.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    table = parquet.read_table(tmp_path / "a.parquet")
    assert str(table.schema.field("ranges").type).endswith("[361]")
    export(episode, "npz", tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        for name in table.column_names:
            rows = np.array(table[name].to_pylist(), dtype=arrays[name].dtype)
            np.testing.assert_array_equal(rows.reshape(arrays[name].shape), arrays[name])
    np.testing.assert_array_equal(table["ranges"][3].values, frames[3].scan.ranges)
    np.testing.assert_array_equal(table["label_kind"][3].values, frames[3].labels.kind)
    told = json.loads(table.schema.metadata[b"mobilia"])
    assert told["recipe"]["seed"] == 1
    assert told["label_kind"]["3"] == "moving"
    assert set(told["units"]) == set(table.column_names)
