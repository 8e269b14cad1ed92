# SPDX-License-Identifier: Apache-2.0
"""The help of every verb as one text: ``python -m tests.help_of_all CHECKOUT``.

Two checkouts side by side::

    diff <(python -m tests.help_of_all ../before) <(python -m tests.help_of_all .)
"""

import os
import subprocess
import sys
from pathlib import Path

PRINT = """
from typer.main import get_command
from scripts.cli import app

def tell(command, words):
    print("$", *words, "--help", flush=True)
    command.main(["--help"], prog_name=" ".join(words), standalone_mode=False)
    for name, verb in getattr(command, "commands", {}).items():
        tell(verb, [*words, name])

tell(get_command(app), ["mobilia"])
"""


def help_of_all(checkout: Path) -> str:
    """What ``mobilia --help`` and each verb's print there, 100 columns wide and without colours."""
    plain = {"COLUMNS": "100", "TERMINAL_WIDTH": "100", "TERM": "dumb", "NO_COLOR": "1"}
    where = {**os.environ, **plain, "PYTHONPATH": str(checkout.resolve())}
    words = [sys.executable, "-c", PRINT]
    return subprocess.run(
        words, cwd=checkout, env=where, capture_output=True, text=True, check=True
    ).stdout


if __name__ == "__main__":
    print(help_of_all(Path(*sys.argv[1:])), end="")
