# SPDX-License-Identifier: Apache-2.0
"""Which files a Python file imports from its own folder or package, found without running it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

INSTALLED = ("site-packages", "dist-packages")


def with_imports(file: Path, module: str) -> tuple[Path, ...]:
    """``file`` and what it imports, directly or not, sorted.

    ``module`` is its dotted name: it tells the folder that holds the module, or the whole package.
    What lies there counts; of what is installed only the package itself. Names made up at run time
    (``importlib.import_module(word)``) and imports from elsewhere on the path are not seen.
    """
    top, *below = module.split(".")
    depth = len(below) + (file.name == "__init__.py")
    root = file.resolve().parents[depth]
    found: set[Path] = set()
    waiting = [(file.resolve(), module)]
    while waiting:
        path, name = waiting.pop()
        if path in found:
            continue
        found.add(path)
        for imported in _imported(path, name):
            if root.name not in INSTALLED or imported.partition(".")[0] == top:
                waiting += _files(root, imported)
    return tuple(sorted(found))


def _imported(path: Path, module: str) -> Iterator[str]:
    """Dotted names; of ``from a import b`` also a.b, which may be a module."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):  # fails in its own way when it is run
        return
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: package.count(".") + 2 - node.level] if node.level else []
            base = [*above, *(node.module or "").split(".")]
            yield from (".".join(filter(None, [*base, alias.name])) for alias in node.names)


def _files(root: Path, module: str) -> Iterator[tuple[Path, str]]:
    """Those of a module and of the packages it is in, as far as they lie under ``root``."""
    parts = module.split(".")
    for n in range(1, len(parts) + 1):
        place, name = root.joinpath(*parts[:n]), ".".join(parts[:n])
        for path in (place / "__init__.py", place.with_name(place.name + ".py")):
            if path.is_file():
                yield path, name
                break
