# SPDX-License-Identifier: Apache-2.0
"""One simulated run on file: what every SLAM gets, and the truth that scores it."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.metrics.judged import world_truth
from sim.moments import Moment, thinned, toured
from sim.recording.recipe import Recipe
from sim.simulation import Simulation
from slam.archives import read_arrays
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import BeamClass, BeamLabels, Float, Frame, LaserSpec, Odometry, Scan
from slam.system import Raster
from slam.trajectory import Trajectory

NOTHING, STATIC = -2, -1  # of ``Recording.hit``
_NUMBERS = ("n_beams", "angle_min", "angle_increment", "range_min", "range_max", "range_sigma_m")
_SPEC = (*_NUMBERS, "beam_time_offsets", "T_robot_laser")


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """n thinned scans of one run, of a scene with m movers.

    frames    n of them, with truth, and with labels of which only the kind is kept
    hit       (n, beams) int16: the mover that each beam met, ``STATIC`` or ``NOTHING``
    poses     (n, m, 3) m, m, rad of the movers in the world, doors at their hinge along the leaf
    moving    (n, m) whether each of them moves
    names, kinds, radii_m  of the movers; a door's radius is the width of its leaf
    closed    (m, 3) pose of a door's closed leaf; of others where they were put
    static_map  what never moves, cut at the scan plane, in the world
    returns   (4,) all beams of the whole run by ``BeamClass``, scans left out by thinning included
    """

    frames: Sequence[Frame]
    hit: NDArray[np.int16]
    poses: Float
    moving: NDArray[np.bool_]
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    radii_m: Float
    closed: Float
    static_map: Raster
    returns: NDArray[np.int64]

    def truth(self) -> Trajectory:
        """True poses in the world."""
        return world_truth(self.frames)

    def share_of_returns(self, kind: BeamClass) -> float:
        """Of all beams that met something, those that met something of that class."""
        return float(self.returns[kind] / max(self.returns[BeamClass.STATIC :].sum(), 1))


def record(path: Path, *, every: int, **recipe: Any) -> None:
    """A job: simulate ``Recipe(**recipe)``, keep every ``every``-th scan, write it to ``path``."""
    wanted = Recipe(**recipe)
    simulation = Simulation(**wanted.simulation())
    scene = simulation.world.scene
    mover_of_body = simulation.world.bodies.mover_of_body
    returns = np.zeros(len(BeamClass), dtype=np.int64)
    rows: list[dict[str, Any]] = []
    for moment in thinned(_counted(toured(simulation, wanted.seconds), returns), every):
        labels = moment.frame.labels
        assert labels is not None
        mover = np.where(labels.body >= 0, mover_of_body[labels.body], NOTHING)
        rows.append(_row(moment, mover, labels.kind))
    truth_map = scene.static_map
    arrays: dict[str, Any] = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    arrays |= {f"laser_{name}": getattr(simulation.spec, name) for name in _SPEC}
    np.savez_compressed(
        path,
        **arrays,
        names=np.array([mover.name for mover in scene.movers]),
        kinds=np.array([mover.kind for mover in scene.movers]),
        radii_m=np.array([mover.radius for mover in scene.movers]),
        closed=np.array([scene.initial[mover.name] for mover in scene.movers]),
        static_map=truth_map.values.astype(np.uint8),
        static_map_resolution_m=truth_map.resolution_m,
        T_world_origin=truth_map.T_map_origin,
        returns=returns,
    )


def _counted(moments: Iterator[Moment], returns: NDArray[np.int64]) -> Iterator[Moment]:
    """The same moments, their beams added to ``returns`` by ``BeamClass``."""
    for moment in moments:
        assert moment.frame.labels is not None
        returns += np.bincount(moment.frame.labels.kind, minlength=len(BeamClass))
        yield moment


def _row(moment: Moment, mover: NDArray[np.int64], kind: NDArray[np.uint8]) -> dict[str, Any]:
    """Of a scan that everybody gets, which met ``mover`` of a ``BeamClass`` ``kind``."""
    frame = moment.frame
    assert frame.scan is not None
    twist = frame.odometry.twist
    return {
        "stamps_ns": frame.stamp_ns,
        "truth": frame.truth,
        "ranges": frame.scan.ranges,
        "T_odom_robot": frame.odometry.T_odom_robot,
        "increment_covariances": frame.odometry.increment_covariance,
        "twists": np.zeros(3) if twist is None else twist,
        "hit": mover.astype(np.int16),
        "label_kinds": kind,
        "mover_poses": moment.poses,
        "moving": moment.moving,
    }


def load(path: Path) -> Recording:
    """Inverse of ``record``; ``LogFormatError`` for a file that is damaged or something else."""
    a = read_arrays(path)
    try:
        return _recording(a)
    except KeyError as error:
        raise LogFormatError(path, f"no recording of a comparison: it lacks {error}") from error
    except (ValueError, TypeError, IndexError, OverflowError, InvalidValueError) as error:
        raise LogFormatError(path, f"no recording of a comparison: {error}") from error


_SEEN = (
    "stamps_ns", "ranges", "T_odom_robot", "increment_covariances", "twists", "truth",
    "label_kinds",
)  # fmt: skip


def digest(path: Path) -> str:
    """SHA-256 of what the SLAMs get of a recording, and of the truth that scores them.

    Not of the file: how it is packed differs between versions of zlib.
    """
    whole = hashlib.sha256()
    for name, array in sorted(read_arrays(path, _SEEN).items()):
        whole.update(f"{name} {array.dtype.str} {array.shape}".encode())
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()


def _labels(kind: NDArray[np.uint8], hit: NDArray[np.int16]) -> BeamLabels:
    """As far as they are kept: ``kind``. Instead of the body the mover, the rest unknown."""
    n = len(kind)
    return BeamLabels(
        body=hit.astype(np.int32),
        kind=kind,
        displacement=np.zeros(n, dtype=np.float32),
        incidence=np.full(n, np.nan, dtype=np.float32),
        mixed=np.zeros(n, dtype=np.bool_),
    )


def _recording(a: Mapping[str, Any]) -> Recording:
    laser = {name: a[f"laser_{name}"] for name in _SPEC}
    spec = LaserSpec(**{k: v.item() if k in _NUMBERS else v for k, v in laser.items()})
    frames = [
        Frame(
            stamp_ns=int(stamp_ns),
            odometry=Odometry(
                stamp_ns=int(stamp_ns),
                T_odom_robot=a["T_odom_robot"][k],
                increment_covariance=a["increment_covariances"][k],
                twist=a["twists"][k],
            ),
            scan=Scan(stamp_ns=int(stamp_ns), ranges=a["ranges"][k], spec=spec),
            truth=a["truth"][k],
            labels=_labels(a["label_kinds"][k], a["hit"][k]),
        )
        for k, stamp_ns in enumerate(a["stamps_ns"])
    ]
    return Recording(
        frames=frames,
        hit=a["hit"],
        poses=a["mover_poses"],
        moving=a["moving"],
        names=tuple(a["names"].tolist()),
        kinds=tuple(a["kinds"].tolist()),
        radii_m=a["radii_m"],
        closed=a["closed"],
        static_map=Raster(
            values=a["static_map"].astype(np.float32),
            resolution_m=float(a["static_map_resolution_m"]),
            T_map_origin=a["T_world_origin"],
        ),
        returns=a["returns"],
    )
