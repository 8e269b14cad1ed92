# SPDX-License-Identifier: Apache-2.0
"""Measured numbers into the pages: ``python -m scripts.quotes``.

Fills the marked places of ``docs/comparing.md`` from ``docs/results/comparison.json``. With
``--check`` nothing is written, and the exit status is 1 where a page says something else.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from scripts.experiments.measured import ended
from scripts.marks import filled, names
from scripts.quotes.texts import texts
from scripts.result_files import RESULTS, ROOT
from slam.errors import InvalidValueError
from slam.files import write_text

PAGES = ("README.md", "docs/comparing.md")


def quoted(text: str, told: dict[str, str], page: object) -> tuple[str, list[str]]:
    """The page as the results say it, and the names of the places where it said something else."""
    differ = []
    for name in names(text):
        if name not in told:
            raise InvalidValueError(f"{page} marks {name}, must be one of {', '.join(told)}")
        now = filled(text, name, told[name], page)
        if now != text:
            differ.append(name)
        text = now
    return text, differ


def main(arguments: Sequence[str] | None = None) -> int:
    """Say what differed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--check", action="store_true", help="write nothing, exit 1 on a difference"
    )
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--root", type=Path, default=ROOT, help="folder of the pages")
    wanted = parser.parse_args(arguments)
    different, told = False, texts(wanted.results)
    for name in PAGES:
        page = wanted.root / name
        text, differ = quoted(page.read_text(encoding="utf-8"), told, name)
        different = different or bool(differ)
        if differ:
            print(f"{name}: {'differs' if wanted.check else 'anew'}: {', '.join(differ)}")
            if not wanted.check:
                write_text(page, text)
    if not different:
        print("the pages say what the results say")
    return 1 if wanted.check and different else 0


if __name__ == "__main__":
    sys.exit(ended(main))
