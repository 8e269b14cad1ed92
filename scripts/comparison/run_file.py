# SPDX-License-Identifier: Apache-2.0
"""The files of ``runs/``: one simulated run with all SLAMs, written and read by one schema."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.comparison.rules import MOST_CELLS, Array, check_shapes
from scripts.comparison.schema import ENTRY, ENTRY_MAP, RUN, SCHEMA
from sim.recording.sums import check_vouched
from slam.archives import Header, read_arrays, read_headers
from slam.errors import LogFormatError
from slam.files import replacing
from slam.frames import Float
from slam.system import Raster

UNKNOWN = 255
Arrays = Mapping[str, NDArray[Any]]
_OF_ALL = ("schema", "slams")  # the rest is of the recording


def merge(path: Path, recording: Path, entries: Mapping[str, Path]) -> list[dict[str, Any]]:
    """Write ``runs/<run>.npz`` from a recording and each SLAM's entry; the rows, SLAM by SLAM."""
    of_recording = [name for name in RUN if name not in _OF_ALL]
    arrays: dict[str, Any] = dict(read_arrays(recording, of_recording))
    rows: list[dict[str, Any]] = []
    for k, (slam, entry) in enumerate(entries.items()):
        own = read_arrays(entry)
        rows.append({"slam": slam, **_row(entry, own.pop("row", None))})
        arrays |= {f"slam{k}_{name}": value for name, value in own.items()}
    arrays["slams"] = np.array(list(entries))
    arrays["schema"] = np.array(SCHEMA)
    headers = {name: Header(array.shape, array.dtype) for name, array in arrays.items()}
    _check_values(path, arrays, _wanted(path, headers))
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **arrays)
    return rows


def _row(entry: Path, text: Any) -> dict[str, Any]:
    try:
        row: dict[str, Any] = json.loads(text.item())
    except (ValueError, TypeError, AttributeError) as error:
        raise LogFormatError(entry, f"no entry of a comparison: {error}") from error
    if not isinstance(row, dict):
        raise LogFormatError(entry, "no entry of a comparison: its row is no object")
    return row


def _read_run(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of the run at ``path``, in full shape; nothing is unpacked before all fit."""
    wanted = _wanted(path, read_headers(path))
    arrays = read_arrays(path, wanted)
    _check_values(path, arrays, wanted)
    # What has no entries was perhaps written without its inner lengths and its type.
    m = {"movers": arrays["radii_m"].size, "scans": len(arrays["stamps_ns"])}
    return {
        name: wanted[name].of_none(m) if array.size == 0 else array
        for name, array in arrays.items()
    }


def _wanted(path: Path, headers: Mapping[str, Header]) -> dict[str, Array]:
    """The arrays that a run with these headers must have, once all types and shapes fit."""
    lengths: dict[str, int] = {}
    check_shapes(path, headers, RUN, lengths)
    wanted = dict(RUN)
    cells = [lengths["rows"] * lengths["columns"]]
    for k in range(lengths["slams"]):
        own = dict(ENTRY)
        if any(f"slam{k}_{name}" in headers for name in ENTRY_MAP):
            own |= ENTRY_MAP
        named = {f"slam{k}_{name}": array for name, array in own.items()}
        inner: dict[str, int] = {}
        check_shapes(path, headers, named, inner)
        cells.append(inner.get("map rows", 0) * inner.get("map columns", 0))
        wanted |= named
    if max(cells) > MOST_CELLS:
        raise LogFormatError(path, f"a map must have at most {MOST_CELLS} cells, got {max(cells)}")
    return wanted


def _check_values(path: Path, arrays: Arrays, wanted: Mapping[str, Array]) -> None:
    for name, array in wanted.items():
        if said := array.wrong(arrays[name]):
            raise LogFormatError(path, f"array {name!r} {said}")
    slams, movers = arrays["slams"].tolist(), arrays["radii_m"].size
    if len(set(slams)) < len(slams):
        raise LogFormatError(path, f"array 'slams' must name each once, got {slams!r:.200}")
    if arrays["hit"].max() >= movers:
        raise LogFormatError(
            path, f"array 'hit' must lie in -2..{movers - 1}, got {arrays['hit'].max()}"
        )
    for k in range(len(slams)):
        stamps = arrays[f"slam{k}_stamps_ns"]
        if not np.array_equal(stamps, arrays["stamps_ns"][: len(stamps)]):
            raise LogFormatError(path, f"array 'slam{k}_stamps_ns' must begin as 'stamps_ns' does")


def _raster(values: NDArray[np.float32], cell_m: NDArray[Any], origin: Float) -> Raster:
    return Raster(values=values, resolution_m=float(cell_m), T_map_origin=origin)


@dataclass(frozen=True, kw_only=True, eq=False)
class Believed:
    """What one SLAM said, at the scans that it answered.

    stamps_ns (k,); poses (k, 3) in the map frame, which is the robot's true first pose;
    covariances (k, 3, 3); converged (k,); milliseconds (k,) of processor time
    map  its last one, in the map frame; None for a SLAM without
    """

    stamps_ns: NDArray[np.int64]
    poses: Float
    covariances: Float
    converged: NDArray[np.bool_]
    milliseconds: Float
    map: Raster | None


class RunFile:
    """A file of ``runs/``; ``LogFormatError`` for one that is damaged or something else.

    slams      names in order
    stamps_ns  (n,); ``truth`` (n, 3) T_world_robot; ``ranges`` (n, beams) m of the shared scans
    mover_poses (n, m, 3), ``moving`` (n, m), ``names``, ``kinds``, ``radii_m`` of the movers
    hit        (n, beams) the mover that each beam met, -1 static, -2 nothing
    static_map what never moves, in the world frame
    laser_angles (beams,) rad, ``laser_range_max`` m, ``T_robot_laser`` of the scanner
    """

    def __init__(self, path: Path, slams: Sequence[str] = (), *, vouched: bool = False) -> None:
        """Of a file.

        slams    that must be in it
        vouched  its hash has been checked
        """
        if not vouched:
            check_vouched(path)
        self._arrays = a = _read_run(path)
        self.slams: list[str] = a["slams"].tolist()
        if absent := [slam for slam in slams if slam not in self.slams]:
            raise LogFormatError(
                path, f"array 'slams' must hold {absent[0]!r:.80}, got {self.slams!r:.200}"
            )
        self.stamps_ns, self.truth, self.ranges = a["stamps_ns"], a["truth"], a["ranges"]
        self.mover_poses, self.moving, self.hit = a["mover_poses"], a["moving"], a["hit"]
        self.names, self.kinds = a["names"].tolist(), a["kinds"].tolist()
        self.radii_m = a["radii_m"]
        beams = np.arange(self.ranges.shape[1])
        self.laser_angles: Float = a["laser_angle_min"] + beams * a["laser_angle_increment"]
        self.laser_range_max = float(a["laser_range_max"])
        self.T_robot_laser: Float = a["laser_T_robot_laser"]
        static = a["static_map"].astype(np.float32)
        self.static_map = _raster(static, a["static_map_resolution_m"], a["T_world_origin"])

    def believed(self, slam: str) -> Believed:
        """What that SLAM said."""
        k = self.slams.index(slam)
        a = {n.partition("_")[2]: v for n, v in self._arrays.items() if n.startswith(f"slam{k}_")}
        raster = None
        if "map" in a:
            values = a["map"].astype(np.float32) / np.float32(254.0)
            values[a["map"] == UNKNOWN] = np.nan
            raster = _raster(values, a["map_resolution_m"], a["T_map_origin"])
        return Believed(**{name: a[name] for name in ENTRY}, map=raster)
