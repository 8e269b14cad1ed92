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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scripts.console import ended
from scripts.experiments.study import add_run_options, head
from scripts.integrity import losses
from scripts.integrity.counting import ALERT_M, bin_quantile, most_of_time, most_of_trials, pooled
from scripts.integrity.ways import WAYS, Case, cases
from scripts.jobs import Job, run_jobs
from scripts.marks import fill_page, table
from scripts.names import file_name
from scripts.options import whole
from scripts.output import configs_of
from scripts.result_files import ROOT, write
from slam.errors import InvalidValueError
from slam.evaluation.statistics import quantile

Row = Mapping[str, Any]
Column = Callable[[Row], str]
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
    bins = pooled([one["ms"] for one in spent])
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
        "timed": sum(bins.values()),
        "p50_ms": bin_quantile(bins, 0.5),
        "p99_ms": bin_quantile(bins, 0.99),
        "p999_ms": bin_quantile(bins, 0.999),
        "longest_ms": max((one["max_ms"] for one in spent), default=math.nan),
    }


def _sum(rows: Sequence[Row], key: str) -> Any:
    return sum(row[key] for row in rows)


def _share(count: float, of: float) -> float:
    return count / of if of > 0 else math.nan


def _told(value: float, digits: int = 2) -> str:
    """A number of a cell; a dash for none, "never" for what lasts."""
    if math.isnan(value):
        return "–"
    return "never" if math.isinf(value) else f"{value:.{digits}f}"


def _number(key: str, digits: int, times: float = 1.0) -> Column:
    return lambda row: _told(times * row[key], digits)


def _count(key: str) -> Column:
    return lambda row: str(row[key])


def _hazardous_share(row: Row) -> str:
    share = _share(row["hazardous"], row["losses"])
    return f"{_told(PERCENT * share)} (≤ {_told(PERCENT * row['most'])})"


def _moments_an_hour(row: Row) -> str:
    return f"{_told(row['moments_per_hour'])} (≤ {_told(row['moments_per_hour_most'])})"


TABLES: tuple[Mapping[str, Column], ...] = (
    {
        "losses": _count("losses"),
        "hazardous": _count("hazardous"),
        "of losses, %": _hazardous_share,
        "scans, %": _number("hazardous_scans", 3, PERCENT),
        "denied, %": _number("denied", 3, PERCENT),
        "misleading, %": _number("misleading", 3, PERCENT),
        "unavailable, %": _number("unavailable", 2, PERCENT),
        "hazardous, 3 σ ≤ 0.5 m": _count("hazardous_protected"),
        "such scans, %": _number("protected", 2, PERCENT),
        "wrong places": _count("wrong_places"),
        "hours": _number("hours", 2),
        "moments an hour": _moments_an_hour,
    },
    {
        "to recover": _count("to_recover"),
        "not": _count("not_recovered"),
        "median, s": _number("recover_s", 2),
        "p90, s": _number("recover_p90_s", 2),
        "worst, s": _number("recover_worst_s", 2),
        "SE(2), cm": _number("se2", 2, CM),
        "p95, cm": _number("se2_p95", 2, CM),
        "unaligned, cm": _number("ate", 2, CM),
        "silent, %": _number("silent", 3, PERCENT),
    },
    {
        "scans": _count("timed"),
        "p50, ms": _number("p50_ms", 1),
        "p99, ms": _number("p99_ms", 1),
        "p99.9, ms": _number("p999_ms", 1),
        "longest, ms": _number("longest_ms", 1),
    },
)
"""Integrity, recovery and errors, times: each column by its heading."""


def markdown(rows: Mapping[tuple[str, str], Row]) -> str:
    """The tables of each SLAM. Keys: SLAM and way."""
    parts = []
    for slam in dict.fromkeys(slam for slam, _ in rows):
        own = {way: row for (name, way), row in rows.items() if name == slam}
        parts.append(f"`{slam}`, hazardous beyond {ALERT_M:g} m:")
        for columns in TABLES:
            cells = [[way, *(cell(row) for cell in columns.values())] for way, row in own.items()]
            parts.append(table(("way", *columns), cells))
    return "\n\n".join(parts)


PAGE, MARK = Path("docs/integrity.md"), "campaign"
LOGS = (".log", ".clf", ".log.gz", ".log.xz")
PLANE = tuple(
    ROOT / "scripts" / "integrity" / f"{name}.py"
    for name in ("driving", "geometry", "kinds", "layouts", "movers", "plane", "things")
)
CODE = (
    ROOT / "slam", *PLANE, ROOT / "scripts" / "metrics",
    *(
        ROOT / "scripts" / "integrity" / f"{name}.py"
        for name in ("counting", "kidnap", "losses", "ways")
    ),
)  # fmt: skip
"""What a case depends on."""


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
        code=(*CODE, *([Path(case.log)] if case.log else [])),
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
