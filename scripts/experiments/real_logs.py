# SPDX-License-Identifier: Apache-2.0
"""SLAMs on logs of real robots, one a row: ``python -m scripts.experiments.real_logs``.

``--code`` names checkouts of this project: each runs its own SLAM, by ``along_log``. What was run
is kept in ``--out`` and not run again until that code, the log or the numbers are others.
"""

import argparse
import csv
import io
import json
import lzma
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from statistics import fmean

import numpy as np

from scripts.console import ended
from scripts.experiments import along_log
from scripts.experiments.command import geometric
from scripts.experiments.judging import Log, Row, Run, judged
from scripts.jobs import Job, run_jobs
from scripts.machine import machine
from scripts.marks import fill_page, table
from scripts.names import file_name
from slam.errors import InvalidValueError, LogFormatError, SlamFailedError
from slam.files import write_bytes, write_text
from slam.logs.unpacking import MAX_CHUNK_BYTES, XZ_MEMORY_BYTES, bounded
from slam.shaped import one_of

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
                             scan=("/driver_laser_navigation/laser_scan",), laser=(0.194, 0.0, 0.0),
                             truth="jarvis_complex/navigation_truth.tum"),
    "jarvis-both": Log(file="jarvis_complex/jarvis_complex_path_fast.bag",
                       scan=("/driver_laser_navigation/laser_scan",
                             "/driver_laser_security/laser_scan"),
                       truth="jarvis_complex/navigation_truth.tum"),
}  # fmt: skip
COLUMNS: Mapping[str, str] = {  # and how its numbers are written
    "log": "", "code": "", "slam": "", "scans": "d", "online_m": ".3f", "final_m": ".3f",
    "relations_online_m": ".4f", "relations_final_m": ".4f", "trusted": ".3f", "hazard": ".3f",
    "jump_m": ".2f", "jumps": "d", "found_s": ".1f", "revisits": "d", "revisits_cm": ".1f",
    "sharp_nats": ".3f",    "nees": ".1f", "p50_ms": ".2f", "p999_ms": ".1f",
}  # fmt: skip
SUMS: Mapping[str, tuple[str, Callable[[Sequence[float]], float]]] = {  # of the logs of a SLAM
    "online_m": ("online_m", geometric), "worst": ("online_m", max),
    "trusted": ("trusted", fmean), "least": ("trusted", min),
    "jumps": ("jumps", sum), "found_s": ("found_s", max), "revisits_cm": ("revisits_cm", max),
    "p999_ms": ("p999_ms", max),
}  # fmt: skip
KEYS, CSV = ("log", "code", "slam"), "real_logs.csv"


def along(path: Path, *, code: str, log: str, words: Sequence[str]) -> None:
    """A job: run it in a process of its own, in the checkout ``code``."""
    command = [sys.executable, along_log.__file__, log, str(path), *words]
    done = subprocess.run(command, cwd=code, capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
        raise SlamFailedError(f"{Path(code).name}, {Path(log).name}: {said[-1]}")


def unpacked(file: Path, folder: Path) -> Path:
    """A log as its reader takes it: a packed bag is unpacked into ``folder``, once.

    Raises ``LogFormatError`` for one that is torn, or too large.
    """
    if not file.name.endswith(".mcap.xz"):
        return file.resolve()
    out = folder.resolve() / f"{file.parent.name}_{file.stem}"
    if not out.exists():
        packed = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=XZ_MEMORY_BYTES)
        try:
            write_bytes(out, bounded(packed, file.read_bytes(), MAX_CHUNK_BYTES))
        except (lzma.LZMAError, ValueError) as error:
            raise LogFormatError(file, str(error)) from error
    return out


def commit_of(code: Path) -> str:
    """Its short hash, and + where files of ``slam`` are others; raises ``InvalidValueError``."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=code, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    if (code / "slam").is_dir():
        with suppress(OSError, subprocess.CalledProcessError):
            changed = git("status", "--short", "slam")
            return git("rev-parse", "--short=8", "HEAD") + "+" * bool(changed)
    raise InvalidValueError(f"--code must be a checkout of this project, got {code}")


def cases(wanted: argparse.Namespace) -> list[tuple[Row, Job]]:
    """Of each log, checkout and SLAM: the keys of its row, and the job of its run."""
    found = []
    for name, code, slam in product(wanted.logs, wanted.code, wanted.slam):
        one_of("--logs", name, LOGS)
        log, commit = LOGS[name], commit_of(code)
        file = unpacked(wanted.data / log.file, wanted.out / "unpacked")
        words = ["--slam", slam, "--config", json.dumps(wanted.config)]
        words += ["--laser", json.dumps(log.laser)] if log.laser else []
        words += ["--scan", *log.scan] if log.scan else []
        way = ""
        if wanted.every != 1:
            words, way = [*words, "--every", str(wanted.every)], f", every {wanted.every}"
        if wanted.backwards:
            words, way = [*words, "--backwards"], f"{way}, backwards"
        told = slam + (json.dumps(wanted.config) if wanted.config else "")
        job = Job(
            name=file_name(f"{name}{way}_{commit}_{told}")[:150],
            call=along,
            arguments={"code": str(code.resolve()), "log": str(file), "words": words},
            code=(code.resolve() / "slam", Path(along_log.__file__), file),
        )
        found.append(({"log": name + way, "code": commit, "slam": told}, job))
    return found


def kept(path: Path, rows: Sequence[Row]) -> list[Row]:
    """The rows of the table at ``path`` that are none of these, and these: by log, as listed."""
    old: list[Row] = []
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            old = [{key: row.get(key, "") for key in COLUMNS} for row in csv.DictReader(file)]
    new = [cells_of(row) for row in rows]
    every = {tuple(row[key] for key in KEYS): row for row in (*old, *new)}
    order = list(LOGS)
    return sorted(every.values(), key=lambda row: order.index(row["log"].partition(",")[0]))


def cells_of(row: Row) -> dict[str, str]:
    """Each column as it is written; "" for what cannot be said of that log."""
    return {
        key: "" if (value := row.get(key)) is None else format(value, form)
        for key, form in COLUMNS.items()
    }


def as_csv(rows: Sequence[Row]) -> str:
    """The table as text."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([list(COLUMNS), *(r.values() for r in rows)])
    return text.getvalue()


def summary(rows: Sequence[Row]) -> str:
    """A table of the cells of all columns: a line a SLAM, over its logs."""
    slams: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        slams.setdefault((row["code"], row["slam"]), []).append(row)
    lines = []
    for slam, own in slams.items():
        numbers = {key: [float(row[key]) for row in own if row[key]] for key, _ in SUMS.values()}
        cells = [f"{how(v):.3g}" if (v := numbers[key]) else "–" for key, how in SUMS.values()]
        lines.append([*slam, *cells])
    return table(["code", "slam", *SUMS], lines, left=2)


def options() -> argparse.ArgumentParser:
    """Of the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of logs")
    parser.add_argument("--logs", nargs="+", default=list(LOGS), metavar="NAME")
    parser.add_argument("--slam", nargs="+", default=["shunting"], metavar="NAME")
    parser.add_argument("--config", type=json.loads, default={}, help="numbers by path, JSON")
    parser.add_argument("--every", type=int, default=1, help="take one scan of so many")
    parser.add_argument("--backwards", action="store_true", help="from the last scan to the first")
    parser.add_argument("--code", nargs="+", type=Path, default=[Path()], metavar="CHECKOUT")
    parser.add_argument("--out", type=Path, default=Path("out/real_logs"))
    parser.add_argument("--page", type=Path, help="fill its marked place with all rows so far")
    return parser


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command: run what is missing, print the table, write ``real_logs.csv``."""
    wanted = options().parse_args(arguments)
    if wanted.every < 1:
        raise InvalidValueError(f"--every must be a whole number >= 1, got {wanted.every}")
    rows: list[Row] = []
    for keys, job in cases(wanted):
        file = run_jobs([job], wanted.out / "runs", title=" ".join(keys.values()))[job.name]
        with np.load(file) as arrays:
            run = Run(**arrays)
        given = along_log.options().parse_args([job.arguments["log"], "", *job.arguments["words"]])
        log = LOGS[keys["log"].partition(",")[0]]
        rows.append(keys | judged(run, log, wanted.data, given))
        write_text(wanted.out / CSV, as_csv(kept(wanted.out / CSV, rows)))
    print(table(list(COLUMNS), [list(cells_of(row).values()) for row in rows], left=3))
    on = f"Measured on: {machine()['processor']}, {machine()['cores']} cores."
    print(f"\n{on}")
    if wanted.page:
        every = kept(wanted.out / CSV, rows)
        whole = table(list(COLUMNS), [list(row.values()) for row in every], left=3)
        fill_page(wanted.page, "real_logs", f"{summary(every)}\n\n{on}\n\n{whole}")


if __name__ == "__main__":
    sys.exit(main())
