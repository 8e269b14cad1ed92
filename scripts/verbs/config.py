# SPDX-License-Identifier: Apache-2.0
"""``mobilia config``: every number of a SLAM, of the actors or of a scanner."""

import json
import math
from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from scripts.console import console
from scripts.spec import REQUIRED, argument, names_of, option, spec

if TYPE_CHECKING:
    from slam.settings import Row, Settings

BY_DEVICE = "TD: technical description 8008970/06-2003, TL: telegram listing 8007954"
ROOMS = ("actors", "dynamism", "crowds")  # what belongs to no SLAM
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of dynamism that are printed


@spec
class Config:
    """Print every number with path, value, unit, meaning and source.

    Any of a SLAM's may be set: [bold]mobilia run shunting --set matching.reward=7[/bold].

    [bold]mobilia config shunting matching[/bold]
    """

    what: str = argument(
        "A SLAM (or a variant, SLAM{PATH=VALUE}), actors, dynamism, crowds or a scanner.",
        REQUIRED,
        complete=names_of("slam.system:names", "sim.sensors.lidar.registry:names"),
    )
    group: str = argument("Only the numbers whose path begins so: matching.local.", "")
    as_json: bool = option("Print JSON for programs, with bounds.", False, "--json")

    def __call__(self) -> None:
        if self.what == "dynamism":
            _print_dynamism(self.as_json)
            return
        if self.what == "crowds":
            _print_crowds(self.as_json)
            return
        from sim.sensors.lidar import numbers

        if numbers.is_scanner(self.what):
            rows, digest, changed = numbers.numbers_of(self.what, BY_DEVICE), {}, {}
        else:
            tree, default = _trees(self.what)
            rows, digest = list(tree.rows()), {"sha256": tree.sha256()}
            changed = tree.differences(default)
        rows = _chosen(rows, self.group)
        if self.as_json:
            _print_json({**digest, "numbers": [_plain(row) for row in rows]})
        else:
            _print(rows, changed)


def _print_json(words: dict[str, Any]) -> None:
    print(json.dumps(words, indent=1, ensure_ascii=False))


def _print_crowds(as_json: bool) -> None:
    """The crowd of each scene at the levels of motion for which it is calibrated."""
    from scenes.crowd import BY_LEVEL, LEVELS, OTHERS_BY_LEVEL

    mixes = {**BY_LEVEL, "any other": OTHERS_BY_LEVEL}
    if as_json:
        words = {
            scene: {f"{at:g}": asdict(crowd) for at, crowd in zip(LEVELS, crowds, strict=True)}
            for scene, crowds in mixes.items()
        }
        _print_json({"crowds": words})
        return
    table = Table(box=None, pad_edge=False)
    table.add_column("scene")
    for at in LEVELS:
        table.add_column(f"motion {at:g}", overflow="fold")
    for scene, crowds in mixes.items():
        table.add_row(scene, *(str(crowd).replace(",", ", ") for crowd in crowds))
    console.print(table)
    console.print("Between two levels the numbers are interpolated. Another: --crowd escorts:6")


def _print_dynamism(as_json: bool) -> None:
    """The dynamism curves: each rate of motion, and change, at five levels."""
    from scripts.result_files import finite
    from sim.core.dynamism import CURVES, Rate

    meaning = "of what can move, the share elsewhere when seen again"
    curves = (*CURVES, Rate("change", meaning, "1", lambda d: d))
    rows = [(rate, [rate.at(level) for level in LEVELS]) for rate in curves]
    if as_json:
        words = [
            {"field": rate.field, "meaning": rate.meaning, "unit": rate.unit,
             "values": dict(zip(map(str, LEVELS), map(finite, values), strict=True))}
            for rate, values in rows
        ]  # fmt: skip
        _print_json({"rates": words})
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("dynamism", "", *(f"{level:g}" for level in LEVELS), "unit"):
        table.add_column(heading, justify="left" if heading in ("dynamism", "") else "right")
    for rate, values in rows:
        cells = [f"{value:.3g}" for value in values]
        table.add_row(rate.field, rate.meaning, *cells, "" if rate.unit == "1" else rate.unit)
    console.print(table)


def _trees(what: str) -> "tuple[Settings, Settings]":
    """That tree and its default."""
    from slam.errors import UnknownNameError, meant

    if what == "actors":
        from sim.actors.config import ACTORS

        return ACTORS, ACTORS
    from slam import config_of, names

    found = config_of(what)
    if found is None:
        from sim.sensors.lidar import registry

        known = [name for name in names() if config_of(name) is not None]
        known += [*ROOMS, *registry.names()]
        hint = "" if what in names() else meant(what.partition("{")[0], known)
        raise UnknownNameError(
            f"'{what}' has no numbers to set.{hint} These have: {', '.join(known)}"
        )
    return found


def _chosen(rows: "list[Row]", group: str) -> "list[Row]":
    from slam.errors import UnknownNameError, meant

    def within(path: str) -> bool:
        return not group or f"{path}.".startswith(f"{group}.")

    chosen = [row for row in rows if within(row.path) or within(row.about.alias or row.path)]
    if not chosen:
        groups = sorted({row.path.rpartition(".")[0] for row in rows} - {""})
        hint = meant(group, [*groups, *(r.path for r in rows)], 0.5)
        hint = hint or f" Groups: {', '.join(groups)}"
        raise UnknownNameError(f"no number's path begins with '{group}'.{hint}")
    return chosen


def _plain(row: "Row") -> dict[str, Any]:
    about = row.about
    words: dict[str, Any] = {
        "path": row.path, "value": row.value, "unit": about.unit, "meaning": about.meaning,
        "source": about.source, "fixed": about.fixed,
    }  # fmt: skip
    if about.options and not about.fixed:
        return words | {"options": list(about.options)}
    if about.fixed or math.isinf(about.low):  # a scanner's: its config checks itself
        return words
    return words | {"low": about.low, "high": about.high}


def _print(rows: "list[Row]", changed: dict[str, Any]) -> None:
    from slam.settings import BY_HAND

    table = Table(box=None, pad_edge=False, show_header=False, width=min(console.width, 110))
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(ratio=1)
    all_fixed = all(row.about.fixed for row in rows)
    for group, members in groupby(rows, key=lambda row: row.path.rpartition(".")[0]):
        table.add_row(f"[bold]{escape(group)}[/bold]" if group else "")
        for row in members:
            about = row.about
            source = "" if about.source in (BY_HAND, BY_DEVICE) else f" ({about.source})"
            fixed = " Fixed." if about.fixed and not all_fixed else ""
            value = f"[bold]{row.value}[/bold]" if row.path in changed else f"{row.value}"
            unit = "" if about.unit in ("word", "1") else about.unit
            name = row.path.rpartition(".")[2]
            said = escape(f"{about.meaning}.{source}{fixed}")
            table.add_row(f"  {escape(name)}", value, escape(unit), said)
    console.print(table)
    fixed = " All are fixed: compiled into kernels." if all_fixed else ""
    unsaid = {row.about.source for row in rows} & {BY_HAND, BY_DEVICE}
    others = f" Without a source in brackets: {'; '.join(sorted(unsaid))}." if unsaid else ""
    console.print(f"{len(rows)} numbers.{fixed}{others}", highlight=False)
