# SPDX-License-Identifier: Apache-2.0
"""The tables and files of a comparison, and how to read them back.

compared = read(Path("out/compare"))
compared.runs[0]["ate_unaligned_m"]                     # a row of runs.csv, None for empty
run = compared.run("office", 0.5, 100)                   # a file of runs/
run.believed("shunting").poses, run.truth, run.static_map
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.comparison.columns import COLUMNS
from scripts.comparison.plan import LEVEL, Run
from scripts.knobs import AXES
from scripts.output import check_whole
from sim.recording.sums import check_vouched
from slam.archives import read_arrays
from slam.bounded import check_file
from slam.csv_cells import cell_of, word_of
from slam.errors import InvalidValueError, LogFormatError
from slam.files import replacing, write_text
from slam.frames import Float
from slam.system import Raster

SCHEMA = 1
RUNS, RUNS_JSON, LEVELS, PAIRED = "runs.csv", "runs.json", "levels.csv", "paired.csv"
AGES, AGES_LEVELS = "ages.csv", "ages_levels.csv"
UNKNOWN = 255
Row = dict[str, Any]


def write_csv(
    path: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str], axis: str = "dynamism"
) -> None:
    """One line for each row; None and NaN are empty, numbers are written so that they read back.

    axis  how the column "dynamism" is called on file: what the levels are of
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([axis if column == "dynamism" else column for column in columns])
    for row in rows:
        writer.writerow([_cell(row.get(column)) for column in columns])
    write_text(path, text.getvalue())


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return repr(value) if isinstance(value, float) else cell_of(str(value))


def write_json(path: Path, rows: Sequence[Mapping[str, Any]], axis: str = "dynamism") -> None:
    """``{"schema": 1, "runs": [...]}``; null where a cell is empty. ``axis``: as ``write_csv``."""
    names = {name: axis if name == "dynamism" else name for name in COLUMNS}
    plain = [{names[name]: _plain(row.get(name)) for name in COLUMNS} for row in rows]
    text = json.dumps({"schema": SCHEMA, "runs": plain}, indent=1, allow_nan=False)
    write_text(path, text + "\n")


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def merge(path: Path, recording: Path, entries: Mapping[str, Path]) -> list[Row]:
    """Write ``runs/<run>.npz`` from a recording and each SLAM's entry; the rows, SLAM by SLAM."""
    arrays: dict[str, Any] = dict(read_arrays(recording, _OF_RECORDING))
    rows: list[Row] = []
    for k, (slam, entry) in enumerate(entries.items()):
        own = read_arrays(entry)
        rows.append({"slam": slam, **_row(entry, own.pop("row", None))})
        arrays |= {f"slam{k}_{name}": value for name, value in own.items()}
    arrays["slams"] = np.array(list(entries))
    arrays["schema"] = np.array(SCHEMA)
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **arrays)
    return rows


def _row(entry: Path, text: Any) -> Row:
    try:
        row: Row = json.loads(text.item())
    except (ValueError, TypeError, AttributeError) as error:
        raise LogFormatError(entry, f"no entry of a comparison: {error}") from error
    if not isinstance(row, dict):
        raise LogFormatError(entry, "no entry of a comparison: its row is no object")
    return row


_OF_RECORDING = (
    "stamps_ns", "truth", "ranges", "hit", "mover_poses", "moving", "names", "kinds", "radii_m",
    "closed", "static_map", "static_map_resolution_m", "T_world_origin", "laser_angle_min",
    "laser_angle_increment", "laser_range_max", "laser_T_robot_laser",
)  # fmt: skip


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

    def __init__(self, path: Path) -> None:
        check_vouched(path)
        self._arrays = read_arrays(path)
        try:
            self._take()
        except KeyError as error:
            raise LogFormatError(path, f"no run of this schema: it lacks {error}") from error
        except (ValueError, TypeError, IndexError, InvalidValueError) as error:
            raise LogFormatError(path, f"no run of a comparison: {error}") from error

    def _take(self) -> None:
        a = self._arrays
        self.slams: list[str] = a["slams"].tolist()
        self.stamps_ns, self.truth, self.ranges = a["stamps_ns"], a["truth"], a["ranges"]
        self.mover_poses, self.moving, self.hit = a["mover_poses"], a["moving"], a["hit"]
        self.names, self.kinds = a["names"].tolist(), a["kinds"].tolist()
        self.radii_m = a["radii_m"]
        beams = np.arange(self.ranges.shape[1])
        self.laser_angles: Float = a["laser_angle_min"] + beams * a["laser_angle_increment"]
        self.laser_range_max = float(a["laser_range_max"])
        self.T_robot_laser: Float = a["laser_T_robot_laser"]
        self.static_map = Raster(
            values=a["static_map"].astype(np.float32),
            resolution_m=float(a["static_map_resolution_m"]),
            T_map_origin=a["T_world_origin"],
        )

    def believed(self, slam: str) -> Believed:
        """What that SLAM said."""
        k = self.slams.index(slam)
        a = {n.partition("_")[2]: v for n, v in self._arrays.items() if n.startswith(f"slam{k}_")}
        raster = None
        if "map" in a:
            values = a["map"].astype(np.float32) / np.float32(254.0)
            values[a["map"] == UNKNOWN] = np.nan
            raster = Raster(
                values=values,
                resolution_m=float(a["map_resolution_m"]),
                T_map_origin=a["T_map_origin"],
            )
        return Believed(
            stamps_ns=a["stamps_ns"],
            poses=a["poses"],
            covariances=a["covariances"],
            converged=a["converged"],
            milliseconds=a["milliseconds"],
            map=raster,
        )


@dataclass(frozen=True, eq=False)
class Compared:
    """The folder of a comparison."""

    folder: Path

    @cached_property
    def recipe(self) -> Row:
        """``recipe.json``."""
        return read_json(self.folder / "recipe.json")

    @cached_property
    def axis(self) -> str:
        """What the levels are of, of ``scripts.knobs.AXES`` or ``LEVEL``; rows say "dynamism"."""
        return axis_in(self.recipe.get("settings"), self.folder / "recipe.json")

    @cached_property
    def runs(self) -> list[Row]:
        """Rows of ``runs.csv``: numbers as floats (seed and counts too), empty as None."""
        return read_csv(self.folder / RUNS, self.axis)

    @cached_property
    def levels(self) -> list[Row]:
        """Rows of ``levels.csv``."""
        return read_csv(self.folder / LEVELS, self.axis)

    @cached_property
    def paired(self) -> list[Row]:
        """Rows of ``paired.csv``."""
        return read_csv(self.folder / PAIRED, self.axis)

    @cached_property
    def ages(self) -> list[Row]:
        """Rows of ``ages.csv``, a building and SLAM each; none where no SLAM lived in any."""
        return self._if_there(AGES)

    @cached_property
    def ages_levels(self) -> list[Row]:
        """Rows of ``ages_levels.csv``, their summary; none where there is none."""
        return self._if_there(AGES_LEVELS)

    def _if_there(self, name: str) -> list[Row]:
        there = self.recipe["settings"].get("sessions") is not None
        return read_csv(self.folder / name) if there else []

    def run(self, scene: str, dynamism: float, seed: int) -> RunFile:
        """One simulated run with all SLAMs."""
        name = Run(scene=scene, dynamism=dynamism, seed=int(seed), axis=self.axis).name
        return RunFile(self.folder / "runs" / f"{name}.npz")


def read(folder: Path) -> Compared:
    """A comparison on file; ``LogFormatError`` for a folder that holds none, or half of one."""
    check_whole(folder)
    compared = Compared(folder)
    settings = compared.recipe.get("settings")
    if not isinstance(settings, dict) or settings.get("compare_schema") != SCHEMA:
        raise LogFormatError(folder, f"no comparison of schema {SCHEMA}")
    return compared


_WORDS = frozenset(
    {"scene", "slam", "slam_a", "slam_b", "outcome", "failure", "metric", "statistic", "map"}
)


def axis_in(settings: object, path: Path) -> str:
    """What the levels are of by the settings in the recipe ``path``; before, always dynamism."""
    axis = settings.get("axis", AXES[0]) if isinstance(settings, dict) else AXES[0]
    if axis not in (*AXES, LEVEL):
        known = ", ".join((*AXES, LEVEL))
        raise LogFormatError(path, f"axis must be one of {known}, got {axis!r:.80}")
    return str(axis)


def read_csv(path: Path, axis: str = "dynamism") -> list[Row]:
    """The rows of a table: numbers as floats, empty cells as None; vouched for, if by anything.

    axis  as in ``write_csv``
    """
    check_file(path)
    check_vouched(path)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            names = {axis: "dynamism"}
            return [
                {names.get(k, k): _value(k, v) for k, v in row.items()}
                for row in csv.DictReader(file)
            ]
    except (
        OSError,
        ValueError,
        TypeError,
        csv.Error,
    ) as error:  # TypeError: a line of another length
        raise LogFormatError(path, f"no table: {_why(error)}") from error


def _value(column: str, cell: str) -> Any:
    if cell == "":
        return None
    return word_of(cell) if column in _WORDS else float(cell)


def read_json(path: Path) -> Row:
    """The object of a JSON file; vouched for, if by anything."""
    check_file(path)
    check_vouched(path)
    try:
        data: Row = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise LogFormatError(path, f"cannot be read: {_why(error)}") from error
    if not isinstance(data, dict):
        raise LogFormatError(path, "holds no JSON object")
    return data


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
