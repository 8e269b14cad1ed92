# SPDX-License-Identifier: Apache-2.0
"""Of several buildings that ``mobilia lifelong`` has lived in: what was found, does it get worse?

``python -m scripts.experiments.lifelong_bars out/lifelong-*``.

Session 0 maps the building. The error of the last session is compared with that of session 1, the
first in a map, and with that of session 0. Early and late: sessions 1 to 5, and the last five.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.schema import OVER_TIME
from scripts.days.scores import A_DAY, SOON_S, Row, counts, early, late, later, mean
from slam.errors import LogFormatError, MobiliaError


def read(folder: Path) -> dict[str, Any]:
    """lifelong.json of a folder; ``LogFormatError`` for one without."""
    path = folder / "lifelong.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogFormatError(path, f"no lifelong.json: {error}") from error
    if not isinstance(found, dict) or not {"rows", "settings"} <= found.keys():
        raise LogFormatError(path, "must hold rows and settings, as mobilia lifelong writes it")
    return found


def _mean(rows: Sequence[Row], column: str) -> float:
    found = mean(rows, column)
    return float("nan") if found is None else found


def found_line(rows: Sequence[Row]) -> str:
    """Of all sessions after the first: how many were found, how soon, and where."""
    of = counts(rows)
    return (
        f"{of['to_find']} sessions: {of['found']} found, {of['found_soon']} within {SOON_S:g} s, "
        f"{of['wrong']} at a wrong place; of {of['known']} that began where a session before had "
        f"been, {of['known_soon']} so soon"
    )


def summary(buildings: Sequence[dict[str, Any]], slam: str) -> list[str]:
    """Lines on one SLAM in these buildings."""
    own = [[r for r in b["rows"] if r["slam"] == slam] for b in buildings]
    after = [row for rows in own for row in later(rows)]
    lines = [found_line(after)]

    def of(pick: Callable[[Sequence[Row]], list[Row]], column: str) -> float:
        return _mean([row for rows in own for row in pick(rows)], column)

    errors = [_mean([rows[k] for rows in own], "rmse_m") for k in (0, 1, -1)]
    lines.append(
        f"error, cm: session 0 {100 * errors[0]:.1f}, session 1 {100 * errors[1]:.1f}, last "
        f"{100 * errors[2]:.1f}; last to session 1 {errors[2] / errors[1]:.2f}, to session 0 "
        f"{errors[2] / errors[0]:.2f}"
    )
    for column in ("rmse_m", *OVER_TIME):
        first, last = of(early, column), of(late, column)
        if not np.isnan(last):
            lines.append(f"{column}: sessions 1 to 5 {first:.3f}, the last five {last:.3f}")
    lines += [*_ratios(own), *_by_day(own), _by_hour(after)]
    told, false = _mean(after, "outdated_told"), _mean(after, "outdated_false")
    lines.append(
        f"'map outdated here' where it clearly is {told:.2f}, where it hardly is {false:.2f}"
    )
    for age in sorted({r["age"] for b in buildings for r in b.get("ages", [])}):
        rows = [r for b in buildings for r in b["ages"] if r["age"] == age and r["slam"] == slam]
        right = [r for r in rows if r["place"] == "right"]
        soon = sum(r["found_after_s"] <= SOON_S for r in right)
        lines.append(
            f"a map {age} sessions old: {len(right)} of {len(rows)} found at the right place, "
            f"{soon} within {SOON_S:g} s, error {100 * _mean(right, 'rmse_m'):.1f} cm"
        )
    return lines


def _ratios(own: Sequence[Sequence[Row]]) -> list[str]:
    """The last error to that of session 1, from the best to the worst building."""
    pairs = [(rows[-1]["rmse_m"], rows[1]["rmse_m"]) for rows in own if len(rows) > 1]
    found = sorted(last / first for last, first in pairs if last is not None and first)
    return [f"last to session 1, by building: {found[0]:.2f} to {found[-1]:.2f}"] if found else []


def _by_day(own: Sequence[Sequence[Row]]) -> list[str]:
    """Means of each whole day of sessions, of two days and more."""
    days = min(len(rows) - 1 for rows in own) // A_DAY
    lines = []
    for column in ("rmse_m", *OVER_TIME) if days > 1 else ():
        means = (
            _mean([r for rows in own for r in rows[1 + A_DAY * d : 1 + A_DAY * (d + 1)]], column)
            for d in range(days)
        )
        lines.append(f"{column}, day by day: " + ", ".join(f"{m:.4f}" for m in means))
    return lines


def _by_hour(rows: Sequence[Row]) -> str:
    """Mean ghost rate at each time of the day."""
    hours = dict.fromkeys(row["time_of_day"] for row in rows)
    means = {h: _mean([r for r in rows if r["time_of_day"] == h], "ghost_rate") for h in hours}
    return "ghost_rate by hour: " + ", ".join(f"{h} {m:.4f}" for h, m in means.items())


def changes_line(buildings: Sequence[dict[str, Any]]) -> str:
    """Precision and recall of the changes of all; of those whose sessions were found."""
    scores = [b["changes"] for b in buildings if b.get("changes")]
    if not scores:
        return "changes: none was looked for, no session was found"
    listed, right, seen, told = (
        sum(s[name] for s in scores) for name in ("listed", "right", "seen", "told")
    )
    doors, moved = (np.sum([s[name] for s in scores], axis=0) for name in ("doors", "moved"))
    return (
        f"changes: precision {right / max(listed, 1):.2f} ({right} of {listed}), recall "
        f"{told / max(seen, 1):.2f} ({told} of {seen}); truly so: doors {doors[1]} of {doors[0]}, "
        f"moved {moved[1]} of {moved[0]}"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the lines, for each share of change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--slam", default="shunting")
    wanted = parser.parse_args(arguments)
    try:
        read_all = [read(folder) for folder in wanted.folders]
    except MobiliaError as error:
        print(error, file=sys.stderr)
        return 1
    known = set.intersection(*({row["slam"] for row in b["rows"]} for b in read_all))
    if wanted.slam not in known:
        parser.error(f"--slam must be one of {', '.join(sorted(known))}, got {wanted.slam!r:.80}")
    for change in sorted({b["settings"]["change"] for b in read_all}):
        chosen = [b for b in read_all if b["settings"]["change"] == change]
        seeds = ", ".join(str(b["settings"]["seed"]) for b in chosen)
        print(f"change {change:g}, seeds {seeds}")
        for line in [*summary(chosen, wanted.slam), changes_line(chosen)]:
            print(f"  {line}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
