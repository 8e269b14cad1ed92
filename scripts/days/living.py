# SPDX-License-Identifier: Apache-2.0
"""One SLAM in one simulated building, from recordings of its sessions: a job that can be killed."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from scripts.comparison.entry import whole_result
from scripts.days import lifelong
from scripts.days.sessions import Drive, loaded
from slam.errors import LogFormatError
from slam.files import write_text
from slam.guests import Limits

SCHEMA = 1
_KEYS = {"rows": list, "ages": list, "failure": str | None}


def live(
    path: Path, *, sessions: Sequence[str], slam: str, scan_limit_s: float = Limits.scan_s
) -> None:
    """A job: let ``slam`` live through the recordings ``sessions`` (beside ``path``'s folder), and
    write its rows (``lifelong.COLUMNS``, ``ages.COLUMNS``) to ``path`` as JSON.

    Its maps are not kept. A SLAM from outside runs in a process of its own for each session; one
    that fails, even at its start, is a row.
    """
    out = path.parent.parent
    limits = Limits(scan_s=scan_limit_s, hidden=(whole_result(out),))
    with tempfile.TemporaryDirectory() as folder:
        (building,) = lifelong.started([slam], Path(folder), limits)
        last: list[Drive] = []
        files = [out / name for name in sessions]
        rows = list(lifelong.rows([building], _last_kept(loaded(files), last)))
        aged = [] if building.anew else list(lifelong.age_rows(building, last[0]))
    failure = building.failures[0] if building.failures else None
    whole = {"schema": SCHEMA, "rows": rows, "ages": aged, "failure": failure}
    write_text(path, json.dumps(whole, indent=1) + "\n")


def _last_kept(drives: Iterator[Drive], last: list[Drive]) -> Iterator[Drive]:
    """The same; ``last`` holds the one that came last."""
    for drive in drives:
        last[:] = [drive]
        yield drive


def read(path: Path) -> dict[str, Any]:
    """What ``live`` wrote: "rows", "ages" and "failure"; ``LogFormatError`` for anything else."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogFormatError(path, f"no rows of a building: {error}") from error
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise LogFormatError(path, f"no rows of a building of schema {SCHEMA}")
    wrong = [key for key, kind in _KEYS.items() if not isinstance(found.get(key), kind)]
    if wrong or not found["rows"]:
        raise LogFormatError(path, f"rows of a building without '{(wrong or ['rows'])[0]}'")
    return found
