# SPDX-License-Identifier: Apache-2.0
"""``--jobs`` and ``--cluster``, the same on every verb whose runs go to several processes."""

from __future__ import annotations

from typing import Annotated

import typer

Jobs = Annotated[int, typer.Option(help="Processes of this machine.")]
Cluster = Annotated[
    str | None, typer.Option(help="Or a Dask scheduler, tcp://host:port, that shares --out.")
]
