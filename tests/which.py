# SPDX-License-Identifier: Apache-2.0
"""Which test files hold a file: ``python -m tests.which slam/tracker/tracker.py``.

Those that import it; of a file that no test imports, those of the files that import it, and so on.
Of what is loaded by its name (scenes, guests, verbs) and of packages, those of the mirrored folder.
``python -m pytest $(python -m tests.which FILE ...)`` runs them.
"""

import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from tests.test_imports import ROOT, files, imported, imports


@cache
def tests() -> Mapping[Path, set[str]]:
    """Which files of ours each file of tests imports."""
    return {path: imported(path) for path in sorted((ROOT / "tests").rglob("test_*.py"))}


def holders(name: str) -> list[Path]:
    """Of the file with this dotted name, the nearest only."""
    nearest, seen = {name}, {name}
    while nearest:
        found = [path for path, used in tests().items() if used & nearest]
        if found:
            return found
        nearest = {other for other, used in imports().items() if used & nearest} - seen
        seen |= nearest
    mirror = ROOT / "tests" / files()[name].relative_to(ROOT).parent
    while not (found := sorted(mirror.glob("test_*.py"))):
        mirror = mirror.parent
    return found


def named(path: Path) -> Iterator[str]:
    """Dotted names of a file, or of all in a folder."""
    whole = path.resolve()
    yield from (name for name, file in files().items() if file == whole or whole in file.parents)


if __name__ == "__main__":
    names = [name for word in sys.argv[1:] for name in named(Path(word))]
    found = sorted({path for name in names for path in holders(name)})
    print("\n".join(path.relative_to(ROOT).as_posix() for path in found))
    sys.exit(not names)
