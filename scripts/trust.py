# SPDX-License-Identifier: Apache-2.0
"""``--trust``: names of code that a file holds, admitted as if the user had typed them."""

from __future__ import annotations

from typing import Annotated

import typer

from scripts.console import note
from slam.names import NameFromFile, is_code, refuse_code

Trust = Annotated[
    bool,
    typer.Option(
        "--trust", help="Run the code that RUN's files name: module:Class, module:function, pipe:."
    ),
]


def admitted(name: str, what: str, trust: bool) -> str:
    """``name`` as it may be resolved; with ``trust`` one line says what is about to run.

    what  "SLAM" or "scene"
    Raises ``UntrustedNameError`` for a name of code that a file holds, without ``trust``.
    """
    if not (isinstance(name, NameFromFile) and is_code(name)):
        return name
    if not trust:
        refuse_code(name, what)
    note(f"--trust: running the {what} {str(name)!r}, which {name.file} names")
    return name.trusted()
