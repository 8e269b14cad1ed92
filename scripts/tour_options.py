# SPDX-License-Identifier: Apache-2.0
"""``--seconds``, ``--dynamism``, ``--seed`` and ``--scan-height`` of one simulated tour."""

from __future__ import annotations

from typing import Annotated

import typer

Seconds = Annotated[float, typer.Option(help="Length of the simulated tour, s.")]
DynamismLevel = Annotated[
    float, typer.Option(help="How much the simulated room moves: 0 nothing, 1 most.")
]
Seed = Annotated[int, typer.Option(help="Seed of the simulated run, whole number >= 0.")]
ScanHeight = Annotated[
    float, typer.Option(help="Height of the simulated scanner above the floor, m.")
]
