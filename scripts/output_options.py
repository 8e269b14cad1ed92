# SPDX-License-Identifier: Apache-2.0
"""``--overwrite``, the same on every verb that writes the folder of one run."""

from __future__ import annotations

from typing import Annotated

import typer

Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace an earlier run in that folder.")
]
