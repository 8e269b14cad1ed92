# SPDX-License-Identifier: Apache-2.0
"""Results into a page: ``python -m scripts.reproduce.quote out/reproduce docs/paper.md``.

Between ``<!-- landmarks -->`` and ``<!-- /landmarks -->`` (and so on) the page gets what the
experiment's ``summary.md`` says; experiments that were not run keep what is there.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.reproduce.verb import EXPERIMENTS
from slam.errors import InvalidValueError
from slam.files import write_text


def quote(results: Path, page: Path) -> list[str]:
    """Fill in the page; which experiments it now quotes anew."""
    text, quoted = page.read_text(), []
    for name in EXPERIMENTS:
        summary, begin, end = (
            results / name / "summary.md",
            f"<!-- {name} -->\n",
            f"<!-- /{name} -->",
        )
        if not summary.exists():
            continue
        if text.count(begin) != 1 or text.count(end) != 1:
            raise InvalidValueError(f"{page} must have one {begin.strip()} and one {end}")
        before, _, rest = text.partition(begin)
        text = f"{before}{begin}\n{summary.read_text().strip()}\n\n{end}{rest.partition(end)[2]}"
        quoted.append(name)
    write_text(page, text)
    return quoted


def main(arguments: list[str] | None = None) -> int:
    """Say what was quoted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="folder that reproduce wrote")
    parser.add_argument("page", type=Path, help="Markdown page with the marks")
    wanted = parser.parse_args(arguments)
    print("quoted:", ", ".join(quote(wanted.results, wanted.page)) or "nothing")
    return 0


if __name__ == "__main__":
    sys.exit(main())
