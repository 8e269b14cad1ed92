# SPDX-License-Identifier: Apache-2.0
"""Small results of every verb, and those who read them, for ``damage``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from scripts.closed_loop import make as drives
from scripts.closed_loop.folder import driven
from scripts.closed_loop.plan import Plan as DrivePlan
from scripts.comparison import make as comparisons
from scripts.comparison.folder import read
from scripts.comparison.plan import Plan
from scripts.comparison.run_file import RunFile
from scripts.debugger.episode import case_of
from scripts.film.footage import of_log, open_run
from scripts.report import page
from scripts.report.study import study
from scripts.verbs.blame import blame
from scripts.verbs.generate import generate
from scripts.verbs.run import run
from sim.loop import LoopConfig
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.shunting.config import ShuntingConfig
from slam.system import Raster
from slam.tracker import map_file as memory

Outcome = Any  # compared with ==
COMPARED = Plan(
    slams=("odometry", "shunting"), scenes=("arena",), levels=(0.0, 1.0), seeds=(0,),
    seconds=1.5, every=8, scanner="ideal",
)  # fmt: skip
DRIVEN = DrivePlan(
    scene="arena", slams=("odometry",), levels=(0.5,), seeds=(0,), goals=1,
    loop=LoopConfig(limit_s=2.0),
)  # fmt: skip
_MEASURED = ("ms_per_scan_p50", "ms_per_scan_p99", "ms_per_scan_p999", "peak_memory_mb")


def _dataset(folder: Path) -> Path:
    generate(["arena"], folder, episodes=2, seconds=1.0, scanner="ideal")
    return folder


def _run(folder: Path) -> Path:
    run(["shunting"], scene="arena", seconds=1.0, out=folder, film=False)
    return folder


def _comparison(folder: Path) -> Path:
    comparisons.carry_out(COMPARED, folder)
    page.write(study(folder))
    return folder


def _drive(folder: Path) -> Path:
    drives.carry_out(DRIVEN, folder)
    return folder


def _blame(folder: Path) -> Path:
    blame(scene="arena", seconds=1.0, slam="odometry", at=0.5, lead=0.2, horizon=0.2, repeats=1,
          top=1, out=folder)  # fmt: skip
    return folder


def _map(folder: Path) -> Path:
    """``map.npz`` alone, with nothing beside it that vouches for it."""
    slam = ShuntingSlam()
    for frame in _frames_of(folder.with_name("driven"), 20):
        slam.update(frame)
    slam.save(folder / "map.npz")
    return folder


def _raster(folder: Path) -> Path:
    """``map.yaml`` and ``map.pgm``, which hold their own sums."""
    values = np.random.default_rng(0).random((30, 40), dtype=np.float32)
    raster = Raster(values=values, resolution_m=0.05, T_map_origin=np.zeros(3))
    write_map(folder / "map", raster)
    return folder


def _frames_of(scratch: Path, count: int) -> list[Any]:
    generate(["arena"], scratch, episodes=1, seconds=1.0, scanner="ideal")
    stream = of_log(next(scratch.glob("arena-*"))).stream
    return [frame.without_truth() for frame, _ in zip(stream, range(count), strict=False)]


SAMPLES: dict[str, Callable[[Path], Path]] = {
    "dataset": _dataset,
    "run": _run,
    "comparison": _comparison,
    "drive": _drive,
    "counterfactual": _blame,
    "map": _map,
    "raster": _raster,
}
# Of a sample that is no folder: what ``verify`` is asked about, and what alone is damaged.
ALONE = {"map": "map.npz", "raster": "map.yaml"}


def consumers(sample: str) -> dict[str, Callable[[Path], Outcome]]:
    """Who reads such a result, and what is to come out the same."""
    return _CONSUMERS.get(sample, {})


def _frames(folder: Path) -> Outcome:
    """``run --log``, ``render`` and ``export`` of a bag: all frames."""
    out: list[Any] = []
    for episode in sorted(folder.glob("arena-*")):
        for frame in of_log(episode).stream:
            ranges = None if frame.scan is None else frame.scan.ranges.tobytes()
            out.append((frame.stamp_ns, ranges, frame.odometry.T_odom_robot.tolist()))
            out.append(None if frame.truth is None else frame.truth.tolist())
    return out


def _titles(folder: Path) -> Outcome:
    """``render`` of episodes, up to the film."""
    return [_title(path) for path in sorted(folder.glob("arena-*"))]


def _title(path: Path) -> Outcome:
    with open_run(path, view=None) as footage:
        settings = json.dumps(footage.made_with, sort_keys=True, default=str)
        return footage.title, footage.duration_s, footage.slam, settings


def _case(path: Path) -> Outcome:
    """``blame`` of a run, up to the drive."""
    case = case_of(path, None, 1)
    recorded = None if case.recorded is None else case.recorded.tolist()
    return str(sorted(case.settings.items())), case.seconds, case.slam, case.every, recorded


def _loaded(folder: Path) -> Outcome:
    """A map to go on in."""
    config, state, arrays = memory.read(folder / "map.npz", ShuntingConfig)
    values = {name: array.tolist() for name, array in arrays.items()}
    return config, state.T_map_robot.tolist(), state.usual, values


def _report(folder: Path) -> Outcome:
    return page.render(study(folder))


def _resumed(folder: Path) -> Outcome:
    """``compare`` again: all rows, but for what is measured, and all runs."""
    rows = comparisons.carry_out(COMPARED, folder)
    again = [{k: v for k, v in row.items() if k not in _MEASURED} for row in rows]
    return repr(again), _runs(folder), [len(read(folder).runs), len(read(folder).paired)]


def _runs(folder: Path) -> Outcome:
    """``blame`` and ``render`` of a comparison's runs: what the files hold."""
    out = []
    for row in range(len(COMPARED.runs())):
        path = folder / "runs" / f"{COMPARED.runs()[row].name}.npz"
        file = RunFile(path)
        poses = [file.believed(slam).poses.tolist() for slam in file.slams]
        out.append((file.truth.tolist(), file.ranges.tobytes(), poses))
    return out


def _cases(folder: Path) -> Outcome:
    return [_case(folder / "runs" / f"{run.name}.npz") for run in COMPARED.runs()]


def _driven_again(folder: Path) -> Outcome:
    drives.carry_out(DRIVEN, folder)
    found = driven(folder)
    return repr(found.settings), repr(found.rows)


def _driven(folder: Path) -> Outcome:
    found = driven(folder)
    return repr(found.settings), repr(found.rows)


_CONSUMERS: dict[str, dict[str, Callable[[Path], Outcome]]] = {
    "dataset": {"run --log": _frames, "render": _titles},
    "run": {"blame": _case, "render": _title, "map": _loaded},
    "comparison": {"report": _report, "compare": _resumed, "blame": _cases, "runs": _runs},
    "drive": {"drive": _driven_again, "report": _driven},
    "map": {"map": _loaded},
}
