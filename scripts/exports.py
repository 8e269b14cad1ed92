# SPDX-License-Identifier: Apache-2.0
"""Recordings in the formats of ``scripts.formats``; each writer says which files it wrote."""

import importlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sim.recording.bag import VERSION
from sim.recording.recipe import RECIPE, read_recipe
from slam.errors import InvalidValueError, LogFormatError
from slam.files import PART, replacing
from slam.frames import EPOCH, BeamClass, LaserSpec, Stream
from slam.logs import open_log, read_bag, write_carmen
from slam.logs.bag_topics import ROS2, Bag, failing_as_ours, is_bag
from slam.trajectory import Trajectory, write_tum


@dataclass(frozen=True)
class Source:
    """A recording."""

    log: Path

    @cached_property
    def stream(self) -> Stream:
        """Its frames, with labels where it has any."""
        return read_bag(self.log, labels=True) if is_bag(self.log) else open_log(self.log)

    @property
    def epoch_ns(self) -> int:
        """What its stamps are more than those of its frames."""
        return int(self.stream.metadata.extra.get(EPOCH, 0))


def write(name: str, target: Path, source: Source) -> list[Path]:
    """The recording in that format, at ``target`` or by names made of it; what was written."""
    written: list[Path] = globals()[name](target, source)
    return written


def tum(target: Path, source: Source) -> list[Path]:
    """Odometry, and the truth where it is known."""
    stamps, odometry, truth = [], [], []
    for frame in source.stream:
        stamps.append(frame.stamp_ns)
        odometry.append(frame.odometry.T_odom_robot)
        truth.append(frame.truth)
    at, epoch_ns = np.array(stamps), source.epoch_ns
    written = [target.with_name(f"{target.stem}_odometry{target.suffix}")]
    write_tum(written[0], Trajectory(stamps_ns=at, poses=np.array(odometry)), epoch_ns)
    known = [k for k, pose in enumerate(truth) if pose is not None]
    if known:
        written.append(target.with_name(f"{target.stem}_truth{target.suffix}"))
        poses = np.array([truth[k] for k in known])
        write_tum(written[-1], Trajectory(stamps_ns=at[known], poses=poses), epoch_ns)
    return written


def carmen(target: Path, source: Source) -> list[Path]:
    """Scans, odometry, true poses."""
    write_carmen(target, source.stream)
    return [target]


def npz(target: Path, source: Source) -> list[Path]:
    """Everything, labels too, as arrays by name."""
    columns, spec = _columns("npz", source.stream)
    facts = {
        "epoch_ns": np.array(source.epoch_ns),
        "angles": spec.angles,
        "beam_time_offsets": spec.beam_time_offsets,
        "range_min_max": np.array([spec.range_min, spec.range_max]),
        "T_robot_laser": spec.T_robot_laser,
    }
    with replacing(target) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **columns, **facts)
    return [target]


def parquet(target: Path, source: Source) -> list[Path]:
    """A row a scan: the arrays of ``npz`` as columns, the scanner and units in the schema."""
    pa, parquet = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    columns, spec = _columns("parquet", source.stream)

    def column(values: NDArray[Any]) -> Any:
        flat = pa.array(values.ravel())
        width = values[0].size
        return flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, width)

    told = json.dumps(_facts(source, spec, list(columns)), sort_keys=True)
    table = pa.table({name: column(values) for name, values in columns.items()})
    with replacing(target) as temporary:
        table = table.replace_schema_metadata({"mobilia": told})
        parquet.write_table(table, temporary, compression="zstd")
    return [target]


UNITS = {
    "stamps_ns": "ns", "T_odom_robot": "m, m, rad", "ranges": "m", "intensities": "",
    "increment_covariance": "m^2, m rad, rad^2: 3 x 3 by rows", "twist": "m/s, m/s, rad/s",
    "T_world_robot": "m, m, rad", "label_body": "", "label_kind": "", "label_displacement": "m",
    "label_incidence": "rad", "label_mixed": "",
}  # fmt: skip


def _facts(source: Source, spec: LaserSpec, names: list[str]) -> dict[str, Any]:
    """What the columns mean, as JSON."""
    recipe = source.log / RECIPE
    return {
        "epoch_ns": source.epoch_ns,
        "scanner": {
            "n_beams": spec.n_beams, "angle_min_rad": spec.angle_min,
            "angle_increment_rad": spec.angle_increment, "range_min_m": spec.range_min,
            "range_max_m": spec.range_max, "T_robot_laser": spec.T_robot_laser.tolist(),
            "beam_time_offsets_s": spec.beam_time_offsets.tolist(),
        },
        "units": {name: UNITS[name] for name in names},
        "label_kind": {int(kind): kind.name.lower() for kind in BeamClass},
        "recipe": read_recipe(recipe).recipe.words() if recipe.exists() else None,
    }  # fmt: skip


def _columns(name: str, stream: Stream) -> tuple[dict[str, NDArray[Any]], LaserSpec]:
    """Arrays with an entry a scan, and the scanner; what not every frame has is left out."""
    frames = list(stream)
    scans = [frame.scan for frame in frames if frame.scan is not None]
    if not scans or len(scans) < len(frames):
        raise InvalidValueError(
            f"{name} holds scans: {len(scans)} of {len(frames)} frames have one"
        )
    spec = scans[0].spec
    if any(scan.spec != spec for scan in scans):
        raise InvalidValueError(
            f"{name} holds scans of one geometry, those of this log differ: give --to carmen"
        )
    columns = {
        "stamps_ns": np.array([f.stamp_ns for f in frames]),
        "T_odom_robot": np.array([f.odometry.T_odom_robot for f in frames]),
        "ranges": np.array([scan.ranges for scan in scans]),
    }
    labels = ("body", "kind", "displacement", "incidence", "mixed")
    parts: list[tuple[str, list[Any]]] = [
        ("intensities", [scan.intensities for scan in scans]),
        ("increment_covariance", [f.odometry.increment_covariance for f in frames]),
        ("twist", [f.odometry.twist for f in frames]),
        ("T_world_robot", [f.truth for f in frames]),
        *((f"label_{each}", [getattr(f.labels, each, None) for f in frames]) for each in labels),
    ]
    there = {key: np.array(values) for key, values in parts if all(v is not None for v in values)}
    return columns | there, spec


def _packed(target: Path, source: Source, plugin: StoragePlugin) -> list[Path]:
    """The very messages of a bag of ROS 2, as one file."""
    _check_ros2(source.log)
    with replacing(target) as temporary, tempfile.TemporaryDirectory(
        prefix=f".{target.stem}.", suffix=PART, dir=target.parent
    ) as scratch:  # fmt: skip
        folder = Path(scratch, target.stem)
        writer = Writer(folder, version=VERSION, storage_plugin=plugin)
        if plugin == StoragePlugin.MCAP:
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            made: dict[tuple[str, str], Connection] = {}
            for theirs, stamp_ns, data in _messages(source.log):
                key = theirs.topic, theirs.msgtype
                if key not in made:
                    made[key] = _added(writer, theirs, source.log)
                writer.write(made[key], stamp_ns, data)
        (packed,) = set(folder.iterdir()) - {folder / "metadata.yaml"}
        packed.replace(temporary)
    return [target]


mcap, db3 = (partial(_packed, plugin=each) for each in (StoragePlugin.MCAP, StoragePlugin.SQLITE3))


def _check_ros2(log: Path) -> None:
    """``InvalidValueError`` for what is no bag of ROS 2, ``LogFormatError`` for a damaged one."""
    if is_bag(log):
        with Bag(log) as bag:
            if not bag.is_ros1:
                return
    raise InvalidValueError(f"mcap and db3 hold the messages of a bag of ROS 2, {log} is none")


def _messages(log: Path) -> Iterator[tuple[Connection, int, bytes]]:
    """All, by time."""
    with failing_as_ours(log), Reader(log) as reader:
        yield from reader.messages()


def _added(writer: Writer, theirs: Connection, log: Path) -> Connection:
    """The topic in another bag, with its QoS, and its type as it is told or as ROS 2 has it."""
    kind, told, digest, store = theirs.msgtype, theirs.msgdef.data, theirs.digest, ROS2
    if not (told and digest) and kind not in store.types:
        if not told:
            what = f"topic {theirs.topic} does not say what its type {kind} is"
            raise LogFormatError(log, what)
        store = get_typestore(Stores.ROS2_HUMBLE)
        with failing_as_ours(log, f"type {kind}: "):
            store.register(get_types_from_msg(told, kind))
    assert isinstance(theirs.ext, ConnectionExtRosbag2)
    return writer.add_connection(
        theirs.topic, kind, msgdef=told or store.generate_msgdef(kind, ros_version=2)[0],
        rihs01=digest or store.hash_rihs01(kind),
        offered_qos_profiles=theirs.ext.offered_qos_profiles,
        serialization_format=theirs.ext.serialization_format,
    )  # fmt: skip
