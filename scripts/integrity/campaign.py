# SPDX-License-Identifier: Apache-2.0
"""How often is the robot at a wrong place and sure of it? Thousands of losses, counted.

``python -m scripts.integrity.campaign --folder out/integrity --losses 1000 --jobs 2``.

Every way to be lost (``ways.WAYS``) gets so many losses of each SLAM. The way "log" takes part
with ``--logs``, a folder of logs or logs themselves. Each case is a small file in ``--folder``: the
same command again goes on where it was stopped, and does again what another version of the code has
done. ``--no-run`` sums up what is there. Writes ``docs/results/integrity.json`` and the tables of
``docs/integrity.md``. What is counted: ``counting``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scripts.experiments.measured import add_run_options, ended, head
from scripts.integrity import losses
from scripts.integrity.tables import ALL, markdown, summary
from scripts.integrity.ways import WAYS, Case, cases
from scripts.jobs import Job, run_jobs
from scripts.marks import fill_page
from scripts.names import file_name
from scripts.options import whole
from scripts.output import configs_of
from scripts.result_files import ROOT, write
from slam.errors import InvalidValueError

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


def campaign(arguments: Sequence[str] | None = None) -> int:
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
    return 0


if __name__ == "__main__":
    sys.exit(ended(campaign))
