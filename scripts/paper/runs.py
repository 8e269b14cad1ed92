# SPDX-License-Identifier: Apache-2.0
"""What every experiment does: SLAMs over frames, results in one file, numbers over seeds."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import scenes
import sim
import slam
from scripts.imports import code_of
from scripts.jobs import Job
from scripts.metrics.judged import Judged, in_first_frame, world_truth
from scripts.metrics.table import METRICS
from slam.archives import read_arrays
from slam.errors import InvalidValueError, LogFormatError
from slam.evaluation.statistics import paired
from slam.frames import Float, Frame
from slam.replay import Track
from slam.system import SlamSystem
from slam.trajectory import Trajectory

QUANTITIES = ("x", "y", "θ")
FIRST_SEED = 200  # of the simulated runs: nothing was tuned or tested on it and those after it
SEEDS, QUICK_SEEDS = 20, 1
_PARK = frozenset({"features_trees", "aa3_gpsx", "graph_known_association"})


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What was asked for.

    out        folder; each experiment writes into a folder of its own in it
    seeds      simulated runs of each kind; None is 20, with ``quick`` 1
    quick      short runs, to see that all works
    data       folder of the Victoria Park dataset
    processes  that work at the same time
    """

    out: Path
    seeds: int | None = None
    quick: bool = False
    data: Path | None = None
    processes: int = 1

    def __post_init__(self) -> None:
        if self.seeds is not None and self.seeds < 1:
            raise InvalidValueError(f"--seeds must be >= 1, got {self.seeds}")
        if self.processes < 1:
            raise InvalidValueError(f"--jobs must be >= 1, got {self.processes}")
        if self.data is not None and not self.data.is_dir():
            raise InvalidValueError(
                f"--data must be the folder of the Victoria Park dataset, got {self.data}"
            )

    def seed_list(self) -> list[int]:
        """The seeds of the simulated runs; the first is the single run shown as the paper's."""
        n = self.seeds or (QUICK_SEEDS if self.quick else SEEDS)
        return list(range(FIRST_SEED, FIRST_SEED + n))


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One job's file: ``numbers`` (JSON) and ``arrays``."""

    numbers: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]


def save_run(path: Path, numbers: Mapping[str, Any], arrays: Mapping[str, ArrayLike]) -> None:
    """Write a ``Run``; NaN and infinities stay what they are."""
    everything: dict[str, Any] = {name: np.asarray(value) for name, value in arrays.items()}
    everything["numbers"] = np.array(json.dumps(numbers, sort_keys=True))
    with path.open("wb") as file:
        np.savez_compressed(file, **everything)


def load_run(path: Path) -> Run:
    """Read it back; ``LogFormatError`` for anything else."""
    arrays = read_arrays(path)
    try:
        return Run(numbers=json.loads(str(arrays.pop("numbers"))), arrays=arrays)
    except (ValueError, TypeError, KeyError) as error:
        raise LogFormatError(path, f"no run of an experiment: {error}") from error


def job(name: str, call: Any, /, **arguments: Any) -> Job:
    """A job that is made again when what it depends on changes: the SLAMs and the scripts that
    ``call`` imports; with a ``scene`` the simulator and the rooms; with ``data`` the dataset."""
    packages = (slam, sim, scenes) if "scene" in arguments else (slam,)
    data: list[Path] = []
    if "data" in arguments:
        data = park_files(folder := Path(arguments["data"]).resolve())
        arguments["data"] = str(folder)
    code = (*code_of(call, *packages), *data)
    return Job(name=name, call=call, arguments=arguments, code=code)


def park_files(folder: Path) -> list[Path]:
    """Those files of the folder that are of the Victoria Park dataset, sorted."""
    return sorted(path for path in folder.iterdir() if path.name.partition(".")[0] in _PARK)


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of each of ``park_files``."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in park_files(folder)}


def truth_of(frames: Sequence[Frame]) -> Trajectory:
    """The true poses, in the frame of the first."""
    return in_first_frame(world_truth(frames))


def follow(system: SlamSystem, frames: Iterable[Frame], name: str) -> Track:
    """One SLAM over the frames, without their truth."""
    track = Track(name=name, system=system)
    for frame in frames:
        track.take(frame.without_truth())
    return track


def map_arrays(track: Track, suffix: str = "") -> dict[str, Any]:
    """What figures draw of its map: ``ellipses`` of landmarks; ``activities``, ``origin``, ``cell``
    of a raster."""
    landmarks, raster = track.landmarks(), track.map()
    out: dict[str, Any] = {}
    if landmarks is not None:
        out["ellipses" + suffix] = landmarks.ellipses()
    if raster is not None:
        out["activities" + suffix] = np.nan_to_num(raster.values).astype(np.float16)
        out["origin" + suffix] = raster.T_map_origin
        out["cell" + suffix] = raster.resolution_m
    return out


def pose_numbers(estimate: Trajectory, truth: Trajectory) -> dict[str, Any]:
    """RMSE, and the paper's mean(e), var(e), var(p) of x, y and heading."""
    judged = Judged(estimate=estimate, truth=truth)
    return {
        "rmse_m": METRICS["ate_unaligned_m"].of(judged),
        "heading_rmse_rad": METRICS["heading_rmse_rad"].of(judged),
        **statistics(judged.pairs.errors, QUANTITIES),
    }


def statistics(errors: Float, names: Sequence[str]) -> dict[str, Any]:
    """mean(e), var(e) and var(p) of each column; NaN of fewer than two errors."""
    out: dict[str, Any] = {}
    n = len(errors)
    for k, name in enumerate(names):
        e = errors[:, k] if n >= 2 else np.full(2, np.nan)
        mean = float(e.mean())
        out[f"mean {name}"] = mean
        out[f"var_e {name}"] = float(((e - mean) ** 2).sum() / (len(e) - 1))
        out[f"var_p {name}"] = float((e**2).sum() / (len(e) - 1))
    return out


def spread(values: Iterable[float]) -> tuple[float, float, float]:
    """Median and quartiles of the finite ones; NaN where there is none."""
    listed = _finite(values)
    low, median, high = np.percentile(listed, [25, 50, 75]).tolist() if listed else [math.nan] * 3
    return median, low, high


def spread_text(values: Iterable[float], form: str = ".3g") -> str:
    """``median [low, high]`` over the seeds, and of how many when not all gave a number."""
    listed = list(values)
    n = len(_finite(listed))
    if not n:
        return "–"
    middle, low, high = (format(v, form) for v in spread(listed))
    told = f"{middle} [{low}, {high}]" if n > 1 else middle
    return told if n == len(listed) else f"{told} ({n} of {len(listed)})"


def _finite(values: Iterable[float]) -> list[float]:
    return [v for v in values if v is not None and math.isfinite(v)]


def sign_test(first: Sequence[float], second: Sequence[float]) -> tuple[int, str]:
    """In how many pairs of a seed the first is the smaller; wins, losses and the two-sided
    probability of that by chance, in words. No number (NaN) loses against any."""
    a, b = ([math.inf if math.isnan(v) else v for v in values] for values in (first, second))
    row = paired(a, b, less_is_better=True)
    return row["wins"], f"{row['wins']} : {row['losses']}, p = {row['p_sign']:.2g}"


def beaten(wins: int, n: int) -> bool:
    """Whether so many of ``n`` seeds are the project's target: 17 of 20."""
    return wins >= math.ceil(0.85 * n)
