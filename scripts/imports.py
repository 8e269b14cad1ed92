# SPDX-License-Identifier: Apache-2.0
"""What the result of a job depends on: which files its code is, found without running any of it.

Of a file: those that it imports from its own folder or package. Of a job: ``code_of``.
"""

import ast
import importlib.util
import inspect
import shlex
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from scenes import is_file
from slam.names import join_folders, loaded
from slam.variants import COMMANDS, inside

INSTALLED = ("site-packages", "dist-packages")


def with_imports(file: Path, module: str, package: str = "") -> tuple[Path, ...]:
    """``file`` and what it imports, directly or not, sorted; only of ``package`` if one is given.

    ``module`` is its dotted name: it tells the folder that holds the module, or the whole package.
    What lies there counts; of what is installed only the package itself. Names made up at run time
    and imports from elsewhere on the path are not seen.
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
            first, *_ = imported.split(".")
            if first == (package or first) and (root.name not in INSTALLED or first == top):
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


def code_of(
    call: Callable[..., Any], *packages: ModuleType, slam: str = "", scene: str = ""
) -> tuple[Path, ...]:
    """For ``Job.code``: folders of packages, the module of ``call`` with the scripts that it
    imports, the files of a SLAM and of a scene of somebody's own, and what ``--with`` has loaded.
    """
    scripts = scripts_of(inspect.getfile(call), call.__module__)
    # What ``--with`` loads registers names that do not tell where they come from.
    registered = (file for module in loaded() for file in _of_module(module))
    own = (*source_of(slam), *source_of_scene(scene), *registered)
    return (*sources(*packages), *scripts, *own)


def sources(*packages: Any) -> tuple[Path, ...]:
    """The folders of packages, for ``Job.code``."""
    return tuple(Path(package.__file__).parent for package in packages)


@cache
def scripts_of(file: str, module: str) -> tuple[Path, ...]:
    """A script and those that it imports, for ``Job.code`` beside the packages that it calls."""
    folder = Path(__file__).resolve().parent
    found = with_imports(Path(file), module, package=folder.name)
    return tuple(path for path in found if folder in path.parents)


def source_of(slam: str) -> tuple[Path, ...]:
    """The file of a SLAM's own module, or those that a command names, and what Python files among
    them import from beside them: with any of it changed, its runs are made again."""
    slam = inside(slam)
    kind, _, command = slam.partition(":")
    if not command:
        return ()
    if slam.startswith(COMMANDS):
        named = [path for path in map(Path, shlex.split(command)) if path.is_file()]
        return tuple(file for path in named for file in _whole(path, path.stem))
    return _of_module(kind)


def source_of_scene(scene: str) -> tuple[Path, ...]:
    """The files of a scene's own module as ``source_of`` has them, and the plans and parts (MJCF)
    in their folders; or all files of a scene by its file."""
    if is_file(scene):
        from scenes.scene_file import files

        return files(Path(scene))
    module, colon, _ = scene.partition(":")
    python = _of_module(module) if colon else ()
    return (*python, *sorted({xml for file in python for xml in file.parent.glob("*.xml")}))


def _of_module(module: str) -> tuple[Path, ...]:
    join_folders()
    spec = importlib.util.find_spec(module)
    return _whole(Path(spec.origin), module) if spec and spec.origin and spec.has_location else ()


def _whole(file: Path, module: str) -> tuple[Path, ...]:
    return with_imports(file, module) if file.suffix == ".py" else (file,)
