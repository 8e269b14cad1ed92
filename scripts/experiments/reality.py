# SPDX-License-Identifier: Apache-2.0
"""Does simulation predict reality? SLAMs on real logs and on the logs' twins, rank against rank.

python -m scripts.experiments.reality predict --data DATA
python -m scripts.experiments.reality real --data DATA
python -m scripts.experiments.reality after --data DATA
python -m scripts.experiments.reality page

``predict`` runs every SLAM on every twin and writes the errors down. ``real`` needs that file,
which it does not change, and runs the same on the logs. ``after`` simulates again what is known by
then, into a file of its own: that is no prediction. ``page`` sets all of it side by side.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from scripts.console import ended, note
from scripts.log_twin.make import REFERENCE, housed, made, recorded
from scripts.marks import table
from slam import create
from slam.errors import InvalidValueError, MobiliaError
from slam.evaluation.metrics import ate
from slam.files import write_text
from slam.frames import Frame
from slam.replay import Replay
from slam.trajectory import Trajectory

LOGS = {
    "seattle": "seattle/seattle-corrected.log.xz",
    "freiburg-101": "freiburg_101/freiburg-101-corrected.log.xz",
    "edmonton": "edmonton/edmonton-corrected.log.xz",
    "belgioioso": "belgioioso/belgioioso-corrected.log.xz",
    "csail": "mit_csail/csail-corrected.log.xz",
    "fhw": "fhw_museum/fhw-corrected.log.xz",
    "intel": "intel/intel-corrected.log.xz",
}
FIRST = ("seattle", "freiburg-101", "edmonton", "belgioioso", "csail")  # predicted first, seed 0
SLAMS = (
    "shunting", "occupancy", "ekf", "kiss-icp", "genz-icp", "small-gicp",
    "karto", "odometry",
)  # fmt: skip
SEEDS = (0, 1, 2)
FOLDER = Path("docs/reality")
PREDICTED, REAL = FOLDER / "predicted.json", FOLDER / "real.json"
AFTER = FOLDER / "after.json"
NEAR_M = 1.0  # SLAMs that are not lost
DRAWS = 2000  # of the bootstrap over logs
Step = Callable[[Path, Sequence[str], Sequence[str]], None]


def error_of(name: str, frames: Sequence[Frame]) -> float | None:
    """ATE of the online poses, aligned, m; None for a SLAM that failed."""
    replay = Replay.of({name: create(name)})
    try:
        for _ in replay.run(frame.without_truth() for frame in frames):
            pass
        online = replay.tracks[name].online()
    except MobiliaError as error:
        note(f"{name}: {error}")
        return None
    truth = Trajectory(
        stamps_ns=np.array([frame.stamp_ns for frame in frames]),
        poses=np.array([frame.truth for frame in frames]),
    )
    return round(float(ate(online, truth, align="se2").value), 4)


def kept(path: Path) -> dict[str, Any]:
    """What a file holds so far."""
    found: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    return found


def predict(data: Path, logs: Sequence[str], slams: Sequence[str]) -> None:
    """Errors on the twins, of logs without real errors."""
    known = [log for log in logs if log in kept(REAL)]
    if known:
        raise InvalidValueError(
            f"{known[0]} is in {REAL} already: a prediction comes before what it predicts"
        )
    simulate(PREDICTED, data, logs, slams)


def simulate(path: Path, data: Path, logs: Sequence[str], slams: Sequence[str]) -> None:
    """Errors on the twins with every seed; kept one by one."""
    found = kept(path)
    for log in logs:
        row = found.setdefault(log, {"errors_m": {}, "twin": {}})
        with tempfile.TemporaryDirectory() as folder:
            read, scene = housed(recorded(data / LOGS[log], REFERENCE), Path(folder))
            for seed in SEEDS:
                twin = made(read, scene, seed=seed)
                row["twin"] = row["twin"] or twin.words["beside"]
                frames = list(twin.stream)
                for slam in slams:
                    errors = row["errors_m"].setdefault(slam, {})
                    if str(seed) not in errors:
                        errors[str(seed)] = error_of(slam, frames)
                        note(f"{log} twin {seed} {slam}: {errors[str(seed)]} m")
                        write_text(path, json.dumps(found, indent=1) + "\n")


def real(data: Path, logs: Sequence[str], slams: Sequence[str]) -> None:
    """Errors on the logs that have been predicted, against their references."""
    if not PREDICTED.exists():
        raise InvalidValueError(f"{PREDICTED} is missing: predict first")
    predicted, found = kept(PREDICTED), kept(REAL)
    for log in logs:
        if log not in predicted:
            raise InvalidValueError(f"{log} has no prediction in {PREDICTED}")
        frames = recorded(data / LOGS[log], REFERENCE).frames
        row = found.setdefault(log, {})
        for slam in slams:
            if slam not in row:
                row[slam] = error_of(slam, frames)
                note(f"{log} real {slam}: {row[slam]} m")
                write_text(REAL, json.dumps(found, indent=1) + "\n")


def of_seeds(errors: Mapping[str, float | None]) -> float | None:
    """The geometric mean over seeds; None where one failed."""
    values = list(errors.values())
    if not values or any(value is None for value in values):
        return None
    return float(np.exp(np.mean(np.log([max(value, 1e-4) for value in values if value]))))


def correlation(pairs: Mapping[str, Sequence[tuple[float, float]]]) -> tuple[float, float, float]:
    """Mean over logs of Spearman's rank correlation, and its 95 % interval: logs drawn again."""
    by_log = np.array([_spearman(rows) for rows in pairs.values()])
    draws = np.random.default_rng(0).integers(len(by_log), size=(DRAWS, len(by_log)))
    low, high = np.quantile(by_log[draws].mean(axis=1), (0.025, 0.975))
    return float(by_log.mean()), float(low), float(high)


def tables() -> list[str]:
    """The page's tables: what was predicted beside the logs, and what was simulated after."""
    measured = kept(REAL)
    lines, pairs = _beside(kept(PREDICTED), measured)
    lines += ["", f"Rank correlation: {_correlation(pairs)}, the mean of {len(pairs)} logs, logs "
              f"drawn again {DRAWS} times. {_best(pairs)}"]  # fmt: skip
    first = {log: rows for log, rows in pairs.items() if log in FIRST}
    later = {log: rows for log, rows in pairs.items() if log not in FIRST}
    if len(first) > 2 and later:
        each = ", ".join(f"{log} {_spearman(rows):+.2f}" for log, rows in later.items())
        lines += ["", f"Of the {len(first)} logs predicted first: {_correlation(first)}; then "
                  f"{each}."]  # fmt: skip
    near = {log: [pair for pair in rows if max(pair) < NEAR_M] for log, rows in pairs.items()}
    kept_ = {log: rows for log, rows in near.items() if len(rows) > 3}
    if len(kept_) > 2:
        lines += ["", f"Among SLAMs that err by less than {NEAR_M:g} m on both: "
                  f"{_correlation(kept_)}, {len(kept_)} logs."]  # fmt: skip
    after = kept(AFTER)
    whole = {log: row for log, row in after.items() if set(SLAMS) <= set(row["errors_m"])}
    if whole:
        again, pairs = _beside(whole, {log: measured[log] for log in whole if log in measured})
        lines += ["", "After the fact, no prediction:", "", *again]
    return lines


def _beside(
    simulated: Mapping[str, Any], measured: Mapping[str, Any]
) -> tuple[list[str], dict[str, list[tuple[float, float]]]]:
    """A row a log, in each cell the error on the twin and on the log; and these, log by log."""
    slams = [s for s in SLAMS if any(s in row for row in measured.values())]
    rows, pairs = [], dict[str, list[tuple[float, float]]]()
    for log, row in measured.items():
        both = [(of_seeds(simulated[log]["errors_m"].get(s, {})), row.get(s)) for s in slams]
        pairs[log] = [(a, b) for a, b in both if a is not None and b is not None]
        cells = [" / ".join("–" if v is None else f"{v:.2g}" for v in pair) for pair in both]
        rows.append([log, *cells, f"{_spearman(pairs[log]):+.2f}"])
    return table(("log", *(f"`{s}`" for s in slams), "ranks"), rows).splitlines(), pairs


def _spearman(rows: Sequence[tuple[float, float]]) -> float:
    return float(spearmanr(np.array(rows)).statistic)


def _correlation(pairs: Mapping[str, Sequence[tuple[float, float]]]) -> str:
    mean, low, high = correlation(pairs)
    return f"{mean:+.2f} (95 %: {low:+.2f} to {high:+.2f})"


def _best(pairs: Mapping[str, Sequence[tuple[float, float]]]) -> str:
    best = [
        bool(np.argmin([a for a, _ in rows]) == np.argmin([b for _, b in rows]))
        for rows in pairs.values()
    ]
    return f"The best on the twin is the best on the log in {sum(best)} of {len(best)}."


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """One step."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("step", choices=("predict", "real", "after", "page"))
    parser.add_argument("--data", type=Path, default=Path("data"), help="folder of the logs")
    parser.add_argument("--logs", nargs="+", choices=tuple(LOGS), default=tuple(LOGS))
    parser.add_argument("--slams", nargs="+", default=SLAMS)
    given = parser.parse_args(arguments)
    if given.step == "page":
        print("\n".join(tables()))
        return
    steps: dict[str, Step] = {"predict": predict, "real": real, "after": partial(simulate, AFTER)}
    steps[given.step](given.data, given.logs, given.slams)


if __name__ == "__main__":
    sys.exit(main())
