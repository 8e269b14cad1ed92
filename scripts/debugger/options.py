# SPDX-License-Identifier: Apache-2.0
"""The options that make a ``Question``."""

from __future__ import annotations

from typing import Annotated

import typer

Threshold = Annotated[float, typer.Option(help="Rise of the error that counts as a divergence, m.")]
Within = Annotated[float, typer.Option(help="Time within which it rises, s.")]
At = Annotated[float | None, typer.Option(help="Examine this time instead of searching, s.")]
Lead = Annotated[float, typer.Option(help="Time from the checkpoint to the divergence, s.")]
Horizon = Annotated[
    float, typer.Option(help="Time from the divergence to the end of the re-runs, s.")
]
Top = Annotated[int, typer.Option(help="Try only this many of the likeliest; 0: all observed.")]
Who = Annotated[
    list[str] | None,
    typer.Option(
        help="Try only these: a mover, a group (escorts, chairs) or a pattern (group[0-3])."
    ),
]
Repeats = Annotated[int, typer.Option(help="Repeats of original and cure with other noise.")]
