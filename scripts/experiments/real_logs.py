# SPDX-License-Identifier: Apache-2.0
"""SLAMs on logs of real robots, one a row: ``python -m scripts.experiments.real_logs``.

``--code`` names checkouts of this project: each runs its own SLAM, by ``along_log``. What was run
is kept in ``--out`` and not run again until that code, the log or the numbers are others.
"""

import argparse
import ast
import csv
import io
import json
import lzma
import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from scripts.console import ended
from scripts.experiments import along_log, relations, revisits
from scripts.experiments.judging import (
    Run,
    beyond_odometry,
    errors,
    found,
    found_at,
    head_of,
    large,
    nees,
    truth_of,
)
from scripts.jobs import Job, run_jobs
from scripts.machine import machine
from scripts.marks import table
from scripts.names import file_name
from slam.errors import InvalidValueError, SlamFailedError
from slam.files import write_bytes, write_text
from slam.frames import Float
from slam.shaped import one_of

Row = dict[str, Any]
HAZARD_M, JUMP_M = 1.0, 0.5  # trusted and farther off; a step is a jump
FIRST = 40  # scans of which the time is not counted
LEAST_REVISITS, SAME_CM = 3, 20.0  # of scans after a carrying and before: the robot is found


@dataclass(frozen=True, kw_only=True)
class Log:
    """One log and what is known of it.

    relations  file, and its clock less the log's, s; ``dense``: scans are near enough in time
    carried    the first scan after the robot was carried
    truth      TUM file of true poses; else the reference is what the log holds, if anything
    laser      pose on the robot, where the log does not say it; ``scan``: topic, of several
    """

    file: str
    relations: tuple[str, float] | None = None
    dense: bool = False
    carried: int | None = None
    truth: str | None = None
    laser: tuple[float, float, float] | None = None
    scan: str | None = None


LOGS: Mapping[str, Log] = {
    "freiburg-079": Log(file="freiburg_079/freiburg-079-corrected.log.xz", dense=True,
                        relations=("relations/fr079.relations.xz", 1211.356)),
    "intel": Log(file="intel/intel-corrected.log.xz",
                 relations=("relations/intel.relations.xz", 976052857.337)),
    "fhw": Log(file="fhw_museum/fhw-corrected.log.xz"),
    "csail": Log(file="mit_csail/csail-corrected.log.xz"),
    "belgioioso": Log(file="belgioioso/belgioioso-corrected.log.xz"),
    "freiburg-101": Log(file="freiburg_101/freiburg-101-corrected.log.xz"),
    "seattle": Log(file="seattle/seattle-corrected.log.xz", carried=27),
    "edmonton": Log(file="edmonton/edmonton-corrected.log.xz"),
    "acapulco": Log(file="acapulco/acapulco-corrected.log.xz"),
    "wean-1": Log(file="wean_hall/robotdata1.log.xz"),
    "wean-2": Log(file="wean_hall/robotdata2.log.xz"),
    "many-loops": Log(file="turkovs_many_loops/many_loops.log.xz", laser=(0.35, 0.0, 0.0)),
    "kidnap": Log(file="kidnap_dec14/merged.mcap.xz", carried=483),
    "jarvis-security": Log(file="jarvis_complex/security.mcap.xz", laser=(0.895, 0.0, 0.0),
                           truth="jarvis_complex/security_truth.tum"),
    "jarvis-navigation": Log(file="jarvis_complex/jarvis_complex_path_fast.bag",
                             scan="/driver_laser_navigation/laser_scan", laser=(0.194, 0.0, 0.0),
                             truth="jarvis_complex/navigation_truth.tum"),
}  # fmt: skip
COLUMNS: Mapping[str, str] = {  # and how its numbers are written
    "log": "", "code": "", "slam": "", "scans": "d", "online_m": ".3f", "final_m": ".3f",
    "relations_online_m": ".4f", "relations_final_m": ".4f", "trusted": ".3f", "hazard": ".3f",
    "jump_m": ".2f", "jumps": "d", "found_s": ".1f", "revisits": "d", "revisits_cm": ".1f",
    "nees": ".1f", "p50_ms": ".2f", "p999_ms": ".1f",
}  # fmt: skip
KEYS = ("log", "code", "slam")


def along(path: Path, *, code: str, log: str, words: Sequence[str]) -> None:
    """A job: run it in a process of its own, in the checkout ``code``."""
    command = [sys.executable, along_log.__file__, log, str(path), *words]
    done = subprocess.run(command, cwd=code, capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
        raise SlamFailedError(f"{Path(code).name}, {Path(log).name}: {said[-1]}")


def unpacked(file: Path, folder: Path) -> Path:
    """A log as its reader takes it: a packed bag is unpacked into ``folder``, once."""
    if not file.name.endswith(".mcap.xz"):
        return file.resolve()
    out = folder.resolve() / f"{file.parent.name}_{file.stem}"
    if not out.exists():
        write_bytes(out, lzma.decompress(file.read_bytes()))
    return out


def against(run: Run, reference: Float, log: Log) -> Row:
    """The columns of a log with a reference."""
    known = np.isfinite(reference).all(axis=1)
    truth = reference[known]
    row: Row = {}
    for name, poses in (("online_m", run.online), ("final_m", run.final)):
        squares = errors(poses[known], truth, slice(None))[:, :2] ** 2
        row[name] = math.sqrt(float(squares.sum(axis=1).mean()))
    off = errors(run.online[known], truth, head_of(truth, log.carried))
    far = np.hypot(off[:, 0], off[:, 1]) > HAZARD_M
    row["hazard"] = float((run.converged[known] & far).mean())
    if log.carried is not None:
        row["found_s"] = found(run, found_at(large(off), log.carried), log.carried)["found_s"]
    if log.truth is not None:
        row["nees"] = nees(run.online[known], run.covariance[known], truth)
    return row


def by_itself(run: Run, log: Log, given: argparse.Namespace) -> Row:
    """The columns of a log without a reference: by its own scans where the robot is back."""
    frames = list(along_log.frames_of(given))
    told = revisits.judged(frames, run.seconds, run.final, log.carried)
    row: Row = {"revisits": told.count, "revisits_cm": told.apart_cm}
    if log.carried is not None:
        sure = told.count >= LEAST_REVISITS and (told.apart_cm or 0.0) < SAME_CM
        wrong = np.append(large(beyond_odometry(run)), not sure)  # until the last jump, or always
        row |= found(run, found_at(wrong, log.carried), log.carried)
    return row


def by_relations(run: Run, log: Log, data: Path) -> Row:
    """Their columns; none for a log without."""
    if log.relations is None:
        return {}
    known, row = relations.relations_of(data / log.relations[0]), {}
    lines = [] if log.dense else relations.lines_of(data / log.file)
    for which, poses in (("online", run.online), ("final", run.final)):
        dense = relations.by_time(run.seconds, poses)
        at = dense if log.dense else relations.by_odometry(lines, run.reference, poses)
        row[f"relations_{which}_m"] = relations.error_m(known, log.relations[1], at)
    return row


def judged(run: Run, log: Log, data: Path, given: argparse.Namespace) -> Row:
    """All columns of a run; ``given``: the options of ``along_log``."""
    if log.carried is not None:
        carried = -(-log.carried // given.every)
        log = replace(log, carried=len(run.online) - carried if given.backwards else carried)
    reference = run.reference if log.truth is None else truth_of(data / log.truth, run.seconds)
    referred = bool(np.isfinite(reference).any())
    row = against(run, reference, log) if referred else by_itself(run, log, given)
    row |= {"scans": len(run.online), "trusted": float(run.converged.mean())}
    if np.isfinite(run.odometry).all():
        jumps = np.hypot(*beyond_odometry(run)[:, :2].T)
        row |= {"jump_m": float(jumps.max()), "jumps": int((jumps > JUMP_M).sum())}
    spent = run.spent_ms[FIRST:][np.isfinite(run.spent_ms[FIRST:])]
    if len(spent):
        row |= {"p50_ms": float(np.median(spent)), "p999_ms": float(np.quantile(spent, 0.999))}
    return row | by_relations(run, log, data)


def commit_of(code: Path) -> str:
    """Its short hash, and + where files of ``slam`` are others; raises ``InvalidValueError``."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=code, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise InvalidValueError(f"--code must be a checkout of this project, got {code}")
        return done.stdout.strip()

    if not (code / "slam").is_dir():
        raise InvalidValueError(f"--code must be a checkout of this project, got {code}")
    return git("rev-parse", "--short=8", "HEAD") + "+" * bool(git("status", "--short", "slam"))


def cases(wanted: argparse.Namespace) -> list[tuple[Row, Job]]:
    """Of each log, checkout and SLAM: the keys of its row, and the job of its run."""
    found = []
    for name, code, slam in product(wanted.logs, wanted.code, wanted.slam):
        one_of("--logs", name, LOGS)
        log, commit = LOGS[name], commit_of(code)
        file = unpacked(wanted.data / log.file, wanted.out / "unpacked")
        words = ["--slam", slam, "--config", json.dumps(wanted.config)]
        words += ["--laser", json.dumps(log.laser)] if log.laser else []
        words += ["--scan", log.scan] if log.scan else []
        words += ["--every", str(wanted.every)] if wanted.every != 1 else []
        words += ["--backwards"] if wanted.backwards else []
        way = "".join(f", {word}" for word in way_of(wanted))
        told = slam + (json.dumps(wanted.config) if wanted.config else "")
        job = Job(
            name=file_name(f"{name}{way}_{commit}_{told}")[:150],
            call=along,
            arguments={"code": str(code.resolve()), "log": str(file), "words": words},
            code=(code.resolve() / "slam", Path(along_log.__file__), file),
        )
        found.append(({"log": name + way, "code": commit, "slam": told}, job))
    return found


def way_of(wanted: argparse.Namespace) -> list[str]:
    """How else than whole and forwards a log is taken."""
    every = [f"every {wanted.every}"] if wanted.every != 1 else []
    return [*every, *["backwards"] * wanted.backwards]


def kept(path: Path, rows: Sequence[Row]) -> list[Row]:
    """The rows of the table at ``path`` that are none of these, and these: by log, as listed."""
    old: list[Row] = []
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            old = list(csv.DictReader(file))
    new = [{key: told(key, row) for key in COLUMNS} for row in rows]
    every = {tuple(row[key] for key in KEYS): row for row in (*old, *new)}
    order = list(LOGS)
    return sorted(every.values(), key=lambda row: order.index(row["log"].partition(",")[0]))


def told(column: str, row: Row) -> str:
    """A cell; "" for what cannot be said of that log."""
    value = row.get(column)
    return "" if value is None else format(value, COLUMNS[column])


def options() -> argparse.ArgumentParser:
    """Of the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of logs")
    parser.add_argument("--logs", nargs="+", default=list(LOGS), metavar="NAME")
    parser.add_argument("--slam", nargs="+", default=["shunting"], metavar="NAME")
    parser.add_argument("--config", type=numbers, default={}, help="numbers by path; JSON")
    parser.add_argument("--every", type=int, default=1, help="take one scan of so many")
    parser.add_argument("--backwards", action="store_true", help="from the last scan to the first")
    parser.add_argument("--code", nargs="+", type=Path, default=[Path()], metavar="CHECKOUT")
    parser.add_argument("--out", type=Path, default=Path("out/real_logs"))
    return parser


def numbers(words: str) -> Any:
    """JSON, or a literal of Python."""
    return ast.literal_eval(words)


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command: run what is missing, print the table, write ``real_logs.csv``."""
    wanted = options().parse_args(arguments)
    if wanted.every < 1:
        raise InvalidValueError(f"--every must be a whole number >= 1, got {wanted.every}")
    rows = []
    for keys, job in cases(wanted):
        file = run_jobs([job], wanted.out / "runs", title=" ".join(keys.values()))[job.name]
        with np.load(file) as arrays:
            run = Run(**arrays)
        given = along_log.options().parse_args([job.arguments["log"], "", *job.arguments["words"]])
        log = LOGS[keys["log"].partition(",")[0]]
        rows.append(keys | judged(run, log, wanted.data, given))
        every = kept(wanted.out / "real_logs.csv", rows)
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(
            [list(COLUMNS), *(r.values() for r in every)]
        )
        write_text(wanted.out / "real_logs.csv", text.getvalue())
    print(table(list(COLUMNS), [[told(key, row) for key in COLUMNS] for row in rows], left=3))
    on = machine()
    print(f"\nMachine: {on['processor']}, {on['cores']} cores, Python {on['python']}.")


if __name__ == "__main__":
    sys.exit(main())
