# SPDX-License-Identifier: Apache-2.0
"""``--set``, the same on every verb that runs SLAMs."""

from __future__ import annotations

from typing import Annotated

import typer

Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change a number of a SLAM: --set matching.reward=7. With several SLAMs its name "
        "comes first: --set ekf.PATH=VALUE. mobilia config SLAM lists all. Repeatable.",
        metavar="[SLAM.]PATH=VALUE",
    ),
]
