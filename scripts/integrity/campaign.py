# SPDX-License-Identifier: Apache-2.0
"""How often is the robot at a wrong place and sure of it? Thousands of losses, counted.

``python -m scripts.integrity.campaign --folder out/integrity --losses 1000 --jobs 2``.

Every way to be lost (``ways.WAYS``) gets so many losses of each SLAM. The way "log" takes part
with ``--logs``, a folder of logs or logs themselves. Each case is a small file in ``--folder``: the
same command again goes on where it was stopped, and does again what another version of the code has
done. ``--no-run`` sums up what is there. Writes ``docs/results/integrity.json`` and the tables of
``docs/integrity.md``. What is counted: ``counting``.
"""

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import slam
from scripts.console import ended
from scripts.experiments.command import add_run_options, head
from scripts.imports import code_of
from scripts.integrity import losses
from scripts.integrity.counting import ALERT_M, bin_quantile, most_of_time, most_of_trials
from scripts.integrity.ways import WAYS, Case, cases
from scripts.jobs import Job, run_jobs
from scripts.marks import fill_page, table
from scripts.names import file_name
from scripts.options import whole
from scripts.output import configs_of
from scripts.result_files import write
from slam.errors import InvalidValueError
from slam.evaluation.statistics import quantile

Row = Mapping[str, Any]
ALL = "all"
CM, PERCENT, S_PER_HOUR = 100.0, 100.0, 3600.0


def summary(cases: Sequence[Row]) -> dict[str, Any]:
    """Of the files of cases of one way and SLAM, or of several ways.

    hazardous     losses with at least one hazardous scan; ``most`` their share at most (95 %)
    hazardous_protected  the same, of scans whose protection level is within the alert limit
    protected     share of the scans that are trusted, with such a level
    denied        share of the scans that are hazardous, and beyond 3 sigma of the covariance too
    moments       stretches of hazardous scans, of drives and losses; an hour, and at most (95 %)
    recover_s     of outages of drives and of losses after an event: never is infinite
    """
    drives = [case["drive"] for case in cases if "scans" in case["drive"]]
    losses = [loss for case in cases for loss in case["losses"]]
    events = [loss for loss in losses if loss["event"]]
    seen = [*drives, *events]
    scans, hazardous = _sum(seen, "scans"), sum(loss["hazardous"] > 0 for loss in losses)
    hours, moments = _sum(seen, "seconds") / S_PER_HOUR, _sum(seen, "stretches")
    shares = {key: _sum(seen, key) for key in ("denied", "misleading", "unavailable", "protected")}
    took = [float(s) for drive in drives for s in drive["outages"]]
    took += [float(loss["recovered_s"]) for loss in events]
    driven = _sum(drives, "scans")
    silent = sum((drive["silent"] or 0.0) * drive["scans"] for drive in drives)
    se2 = [drive["se2"] for drive in drives]
    spent = [one for case in cases for one in (case["drive"], *case["losses"]) if "ms" in one]
    bins = [one["ms"] for one in spent]
    return {
        "cases": len(cases),
        "failed": sum(bool(case["failed"]) for case in cases),
        "losses": len(losses),
        "hazardous": hazardous,
        "most": most_of_trials(hazardous, len(losses)),
        "hazardous_protected": sum(loss["hazardous_protected"] > 0 for loss in losses),
        "scans": scans,
        "hazardous_scans": _share(_sum(seen, "hazardous"), scans),
        **{key: _share(count, scans) for key, count in shares.items()},
        "wrong_places": _sum(seen, "wrong_places"),
        "hours": hours,
        "moments": moments,
        "moments_per_hour": _share(moments, hours),
        "moments_per_hour_most": most_of_time(moments, hours),
        "to_recover": len(took),
        "not_recovered": sum(math.isinf(s) for s in took),
        "recover_s": quantile(took, 0.5),
        "recover_p90_s": quantile(took, 0.9),
        "recover_worst_s": max(took, default=math.nan),
        "se2": quantile(se2, 0.5),
        "se2_p95": quantile(se2, 0.95),
        "ate": quantile([drive["ate"] for drive in drives], 0.5),
        "silent": _share(silent, driven),
        "timed": sum(sum(one.values()) for one in bins),
        "p50_ms": bin_quantile(bins, 0.5),
        "p99_ms": bin_quantile(bins, 0.99),
        "p999_ms": bin_quantile(bins, 0.999),
        "longest_ms": max((one["max_ms"] for one in spent), default=math.nan),
    }


def _sum(rows: Sequence[Row], key: str) -> Any:
    return sum(row[key] for row in rows)


def _share(count: float, of: float) -> float:
    return count / of if of > 0 else math.nan


def _with_share(row: Row) -> Row:
    return {**row, "share": _share(row["hazardous"], row["losses"])}


def _told(value: float, digits: int | None) -> str:
    """A number of a cell, or a count; a dash for none, "never" for what lasts."""
    if digits is None:
        return str(value)
    if math.isnan(value):
        return "–"
    return "never" if math.isinf(value) else f"{value:.{digits}f}"


def cell(row: Row, names: str, digits: int | None = None, times: float = 1.0) -> str:
    """So many ``times`` a number of a ``summary``; of "number ≤ most" with its upper bound."""
    number, *most = (
        _told(row[name] if digits is None else times * row[name], digits)
        for name in names.split(" ≤ ")
    )
    return number + "".join(f" (≤ {bound})" for bound in most)


TABLES: tuple[Mapping[str, tuple[Any, ...]], ...] = (
    {
        "losses": ("losses",),
        "hazardous": ("hazardous",),
        "of losses, %": ("share ≤ most", 2, PERCENT),
        "scans, %": ("hazardous_scans", 3, PERCENT),
        "denied, %": ("denied", 3, PERCENT),
        "misleading, %": ("misleading", 3, PERCENT),
        "unavailable, %": ("unavailable", 2, PERCENT),
        "hazardous, 3 σ ≤ 0.5 m": ("hazardous_protected",),
        "such scans, %": ("protected", 2, PERCENT),
        "wrong places": ("wrong_places",),
        "hours": ("hours", 2),
        "moments an hour": ("moments_per_hour ≤ moments_per_hour_most", 2),
    },
    {
        "to recover": ("to_recover",),
        "not": ("not_recovered",),
        "median, s": ("recover_s", 2),
        "p90, s": ("recover_p90_s", 2),
        "worst, s": ("recover_worst_s", 2),
        "SE(2), cm": ("se2", 2, CM),
        "p95, cm": ("se2_p95", 2, CM),
        "unaligned, cm": ("ate", 2, CM),
        "silent, %": ("silent", 3, PERCENT),
    },
    {
        "scans": ("timed",),
        "p50, ms": ("p50_ms", 1),
        "p99, ms": ("p99_ms", 1),
        "p99.9, ms": ("p999_ms", 1),
        "longest, ms": ("longest_ms", 1),
    },
)
"""Integrity, recovery and errors, times: each column by its heading."""


def markdown(rows: Mapping[tuple[str, str], Row]) -> str:
    """The tables of each SLAM. Keys: SLAM and way."""
    parts: list[str] = []
    for name in dict.fromkeys(name for name, _ in rows):
        parts.append(f"`{name}`, hazardous beyond {ALERT_M:g} m:")
        own = [(way, _with_share(row)) for (of, way), row in rows.items() if of == name]
        for columns in TABLES:
            lines = ([way, *(cell(row, *of) for of in columns.values())] for way, row in own)
            parts.append(table(("way", *columns), lines))
    return "\n\n".join(parts)


PAGE, MARK = Path("docs/integrity.md"), "campaign"
LOGS = (".log", ".clf", ".log.gz", ".log.xz")


def logs_in(places: Sequence[Path]) -> list[Path]:
    """Logs, and those below folders, sorted; ``InvalidValueError`` for a folder without."""
    found: list[Path] = []
    for place in places:
        inside = [place] if place.is_file() else sorted(place.rglob("*"))
        logs = [path for path in inside if path.is_file() and path.name.endswith(LOGS)]
        if not logs:
            raise InvalidValueError(f"--logs must name a log or a folder with logs, got {place}")
        found += logs
    return found


def job(case: Case) -> Job:
    """The file of a case."""
    return Job(
        name=f"{file_name(case.slam)}-{case.way}-{case.number:06d}",
        call=losses.settle,
        arguments={"case": asdict(case), "config": configs_of([case.slam])},
        suffix=".json",
        code=(*code_of(losses.settle, slam), *([Path(case.log)] if case.log else [])),
    )


def _rows(plan: Sequence[Case], files: Sequence[Path]) -> dict[tuple[str, str], dict[str, Any]]:
    """A sum for each SLAM and way, then of all its ways; ``files`` of the cases, or nowhere."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for case, file in zip(plan, files, strict=True):
        every = found.setdefault((case.slam, ALL), [])
        if file.exists():
            row = json.loads(file.read_text(encoding="utf-8"))
            every.append(row)
            found.setdefault((case.slam, case.way), []).append(row)
    ways = [*dict.fromkeys(case.way for case in plan), ALL]
    order = [(slam, way) for slam in dict.fromkeys(case.slam for case in plan) for way in ways]
    return {key: summary(found[key]) for key in order if key in found}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("out/integrity"), help="of cases")
    parser.add_argument("--losses", type=int, default=1000, help="of every way, at least")
    parser.add_argument("--slams", nargs="+", default=["shunting"])
    parser.add_argument("--ways", nargs="+", default=list(WAYS), help=", ".join(WAYS))
    parser.add_argument("--logs", type=Path, nargs="+", default=[], help="logs, or folders of them")
    parser.add_argument("--no-run", action="store_true", help="sum up what is there")
    add_run_options(parser, "integrity.json", PAGE)
    parser.set_defaults(first_seed=100_000, seconds=150.0)
    return parser


@ended
def campaign(arguments: Sequence[str] | None = None) -> None:
    """Run what is missing, print the tables, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    whole("--losses", wanted.losses, 1)
    plan = list(
        cases(
            wanted.ways, wanted.slams, wanted.losses, wanted.first_seed, wanted.seconds,
            logs_in(wanted.logs),
        )
    )  # fmt: skip
    wanted.seeds = max((case.number for case in plan), default=-1) + 1
    first = head(wanted, MARK, arguments, "slams", "ways", "losses", package="scripts.integrity")
    jobs = [job(case) for case in plan]
    if not wanted.no_run:
        run_jobs(jobs, wanted.folder, processes=wanted.jobs, title="losing robots")
    rows = _rows(plan, [wanted.folder / one.file_name() for one in jobs])
    text = markdown(rows)
    print(text)
    write(wanted.results, first, {"found": {f"{slam} {way}": r for (slam, way), r in rows.items()}})
    if not wanted.no_page:
        fill_page(wanted.page, MARK, text)


if __name__ == "__main__":
    sys.exit(campaign())
