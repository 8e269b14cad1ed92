# SPDX-License-Identifier: Apache-2.0
"""How often is the robot at a wrong place and sure of it? Thousands of losses, counted.

``python -m scripts.integrity.campaign --folder out/integrity --losses 1000 --jobs 2``.

Every way to be lost (``ways.WAYS``) gets so many losses of each SLAM. The way "log" takes part
with ``--logs``, a folder of logs or logs themselves. Each case is a small file in ``--folder``: the
same command again goes on where it was stopped, and does anew what another version of the code has
done. ``--no-run`` sums up what is there. Writes ``docs/results/integrity.json`` and the tables of
``docs/integrity.md``. What is counted: ``counting``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from scripts import workers
from scripts.checked import whole
from scripts.experiments.measured import add_run_options, ended, head
from scripts.integrity.settling import settle, settled
from scripts.integrity.tables import ALL, markdown, summary
from scripts.integrity.ways import WAYS, Case, cases
from scripts.marks import fill_page
from scripts.result_files import write
from slam.errors import InvalidValueError

PAGE, MARK = Path("docs/integrity.md"), "campaign"
LOGS = (".log", ".clf", ".log.gz", ".log.xz")
SAID_S = 60.0  # between two lines on how far it is


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


def _settle_all(missing: Sequence[Case], folder: Path, jobs: int) -> None:
    began = said = time.monotonic()
    call = partial(settle, folder=folder)
    for done, case in enumerate(workers.each(call, missing, jobs=jobs), start=1):
        if time.monotonic() - said > SAID_S or done == len(missing):
            said = time.monotonic()
            left_s = (said - began) / done * (len(missing) - done)
            print(f"{done} of {len(missing)}, {case.way}; {left_s / 60.0:.0f} min left", flush=True)


def _rows(
    plan: Sequence[Case], folder: Path
) -> Iterator[tuple[tuple[str, str], dict[str, Any]]]:  # fmt: skip
    """A sum for each SLAM and way, then of all its ways."""
    for slam in dict.fromkeys(case.slam for case in plan):
        every: list[dict[str, Any]] = []
        for way in dict.fromkeys(case.way for case in plan):
            wanted = [case for case in plan if (case.slam, case.way) == (slam, way)]
            found = [row for row in (settled(case, folder) for case in wanted) if row]
            if found:
                yield (slam, way), summary(found)
            every += found
        yield (slam, ALL), summary(every)


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
    if not wanted.no_run:
        missing = [case for case in plan if settled(case, wanted.folder) is None]
        _settle_all(missing, wanted.folder, wanted.jobs)
    rows = dict(_rows(plan, wanted.folder))
    text = markdown(rows)
    print(text)
    write(wanted.results, first, {"found": {f"{slam} {way}": r for (slam, way), r in rows.items()}})
    if not wanted.no_page:
        fill_page(wanted.page, MARK, text)
    return 0


if __name__ == "__main__":
    sys.exit(ended(campaign))
