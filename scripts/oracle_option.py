# SPDX-License-Identifier: Apache-2.0
"""``--oracle``, the same on every verb that takes it: ``run`` and ``compare``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from slam.set_numbers import with_set
from slam.variants import oracle_named

Oracles = Annotated[
    list[str] | None,
    typer.Option(
        "--oracle",
        help="Also this SLAM without the returns from what can move, by the true labels; "
        "SLAM,moving: from what moves now. Repeatable.",
        metavar="SLAM[,moving]",
    ),
]


def with_oracles(
    slams: Sequence[str], oracles: Sequence[str] | None, set_: Sequence[str] | None
) -> tuple[str, ...]:
    """Names of the SLAMs and of the oracles, each with the numbers of ``--set`` that are for it.

    Raises ``InvalidValueError`` for what is no oracle, and as ``slam.set_numbers.with_set``.
    """
    return with_set([*slams, *map(oracle_named, oracles or ())], set_ or [])
