# SPDX-License-Identifier: Apache-2.0
"""``--format`` and ``--strict``, the same on every verb that reads a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TextFormat = Annotated[
    Path | None,
    typer.Option("--format", help="TOML file that says which columns of a text log hold what."),
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a log that would have to be repaired.")
]
