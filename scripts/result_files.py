# SPDX-License-Identifier: Apache-2.0
"""Results files: small, with a line for each thing measured, and the commit that made them."""

import json
import math
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slam.bounded import json_of
from slam.errors import InvalidValueError, LogFormatError
from slam.files import write_text

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
SCHEMA = 1
MAX_BYTES = 1 << 25
CODE = ("slam", "sim", "scenes", "scripts")


def commit(*code: str) -> str:
    """The last commit that changed ``code`` (paths; default all of it).

    Raises ``InvalidValueError`` where the code here is another than that.
    """
    paths = code or CODE
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", *paths)
    if changed:
        files = ", ".join(line[3:] for line in changed.splitlines())
        raise InvalidValueError(f"commit these first, so that results can name the code: {files}")
    return _git("log", "-1", "--format=%H", "--", *paths)


def _git(*words: str) -> str:
    done = subprocess.run(
        ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    if done.returncode != 0:
        raise InvalidValueError(f"git {words[0]} must work in {ROOT}: {done.stderr.strip()}")
    return done.stdout.rstrip()


def write(path: Path, head: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> None:
    """JSON with a line for each entry of ``head`` and of each table."""
    entries = [f"{json.dumps(key)}: {_plain(value)}" for key, value in head.items()]
    for name, table in tables.items():
        lines = ",\n".join(f"  {json.dumps(key)}: {_plain(row)}" for key, row in table.items())
        entries.append(f"{json.dumps(name)}: {{\n{lines}\n }}")
    write_text(path, "{\n " + ",\n ".join(entries) + "\n}\n")


def _plain(value: Any) -> str:
    return json.dumps(_rounded(value), allow_nan=False)


def _rounded(value: Any) -> Any:
    """Six digits; infinity as "inf", which JSON has no number for, NaN as null."""
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    if not isinstance(value, float):
        return value
    if math.isnan(value):
        return None
    return float(f"{value:.6g}") if math.isfinite(value) else str(value)


def finite(value: Any) -> Any:
    """As strict JSON has it: None where it is no finite number."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def load(
    path: Path,
    what: str = "results file",
    schema: int | None = SCHEMA,
    *,
    strict: bool = False,
) -> dict[str, Any]:
    """The object in a JSON file; ``LogFormatError`` for what is no ``what`` of this schema.

    schema  None: it has none
    strict  without Infinity and NaN
    """
    data = json_of(path, MAX_BYTES, what, strict=strict)
    if schema is not None and data.get("schema") != schema:
        raise LogFormatError(path, f"no {what} of schema {schema}")
    return data
