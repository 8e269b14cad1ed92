# SPDX-License-Identifier: Apache-2.0
"""What experiments leave: a results file with a line for each row, and a table in a page."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.marks import filled
from scripts.output import machine, versions
from sim.core.versions import WORLD
from slam.errors import OutputError
from slam.files import write_text

SCHEMA = 1
Row = dict[str, Any]


def write_results(path: Path, settings: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """``settings``, what made them, and ``rows``; infinity as "inf", NaN as null."""
    head = {
        "schema": SCHEMA,
        "world": WORLD,
        "machine": machine(),
        "versions": versions(),
        **settings,
    }
    lines = [f"{json.dumps(key)}: {_json(value)}" for key, value in head.items()]
    table = ",\n".join(f"  {_json(row)}" for row in rows)
    lines.append(f'"rows": [\n{table}\n ]')
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, "{\n " + ",\n ".join(lines) + "\n}\n")


def _json(value: Any) -> str:
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if not isinstance(value, float):
        return value
    if math.isnan(value):
        return None
    return float(f"{value:.6g}") if math.isfinite(value) else str(value)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; the first column to the left, the others to the right."""
    rule = ["---", *["---:"] * (len(heads) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (heads, rule, *rows))


def fill_page(page: Path, mark: str, told: str) -> None:
    """Put ``told`` at the marked place of a page. Raises ``OutputError`` for no such page."""
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot read {page}: {error.strerror}") from error
    write_text(page, filled(text, mark, told, page))
