# SPDX-License-Identifier: Apache-2.0
"""Names that may be code, and where they come from.

A SLAM is ``module:Class``, ``pipe:COMMAND`` or ``ros2:COMMAND``, a scene ``module:function``,
beside those that are registered. Whoever types such a name, on the command line or in Python, runs
it. A name that was read from a file is a ``NameFromFile``: it resolves to what is registered and to
nothing else, until ``trusted`` makes a name of it as if it had been typed. docs/trust.md has the
whole rule.
"""

import ast
import importlib
import os
import re
import sys
from collections.abc import Iterable, Set
from importlib.util import find_spec
from itertools import product
from pathlib import Path

from slam.errors import InvalidValueError, MobiliaError, UnknownNameError, UntrustedNameError

SAFE_PATH = "PYTHONSAFEPATH"
OURS = "mobilia"  # the value of SAFE_PATH where it was us who set it
_wanted: list[str] = []
_loaded: list[str] = []


class NameFromFile(str):
    """A name as the file ``file`` has it."""

    file: str

    def __new__(cls, text: str, file: str | Path) -> "NameFromFile":
        """``text`` of ``file``."""
        name = super().__new__(cls, text)
        name.file = str(file)
        return name

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """A copy, in another process too, is from that file still."""
        return type(self), (str(self), self.file)

    def trusted(self) -> str:
        """The same as if the user had typed it."""
        return str(self)


NETWORK = re.compile(r"(^|\()ros2(-zenoh)?($|[{)])")  # a node of ROS 2, also inside an oracle


def is_code(name: str) -> bool:
    """Whether to resolve ``name`` is to run what it names, a module or a command, or to open a
    network.
    """
    return ":" in name or NETWORK.search(name) is not None


def refuse_code(name: str, what: str) -> None:
    """Raise ``UntrustedNameError`` for a name of code that was read from a file.

    what  "SLAM" or "scene"
    """
    if isinstance(name, NameFromFile) and is_code(name):
        raise UntrustedNameError(
            f"{name.file} names code to run: {what} {str(name)[:200]!r}. A file may name what is "
            "registered; if you trust it, pass --trust (in Python: give the name yourself)"
        )


def look_in(folder: str) -> None:
    """Let modules be found in ``folder`` too, from the first ``module:name`` that is resolved."""
    _wanted[:] = [folder]


def join_folders() -> None:
    """Put the folder of ``look_in`` at the end of the import path: a module is about to be found.

    Not before: a folder of somebody else's data may hold a module called like one that we import.
    """
    sys.path.extend(folder for folder in _wanted if folder not in sys.path)


def load(modules: Iterable[str]) -> None:
    """Import modules that the user typed, so that what they register is known.

    Raises ``UnknownNameError`` for one that cannot be found, ``InvalidValueError`` for one that
    fails, and ``UntrustedNameError`` for one that was read from a file.
    """
    for name in modules:
        if isinstance(name, NameFromFile):
            raise UntrustedNameError(f"{name.file} names code to run: module {str(name)[:200]!r}")
        if name in _loaded:
            continue
        join_folders()
        try:
            importlib.import_module(name)
        except (ImportError, TypeError) as error:  # TypeError: no name of a module
            raise UnknownNameError(f"module '{name}' cannot be imported: {error}") from error
        except MobiliaError:
            raise
        except Exception as error:  # somebody else's code raises whatever it likes
            what = f"{type(error).__name__}: {error}"
            raise InvalidValueError(f"module '{name}' fails: {what}") from error
        _loaded.append(name)


def loaded() -> tuple[str, ...]:
    """What ``load`` has imported here: a process that we start needs the same."""
    return tuple(_loaded)


def child_environment(*, guest: bool) -> dict[str, str]:
    """Our environment for a child process.

    guest  True for a command of the user, whose Python is to find modules as it always does; False
           for a Python of ours, which takes none from the working folder unasked
    """
    environment = dict(os.environ)
    if not guest:
        environment.setdefault(SAFE_PATH, OURS)
    elif environment.get(SAFE_PATH) == OURS:
        del environment[SAFE_PATH]
    return environment


def first_line(entry: str) -> str:
    """The first line of the docstring of ``entry``, a ``module:name`` of ours.

    Read from its file, for lists: to import it would load a compiler or a physics engine.
    """
    module, _, name = entry.partition(":")
    top = find_spec(module.partition(".")[0])
    root = Path(str(top and top.origin)).parents[1]
    tree = ast.parse(root.joinpath(*module.split(".")).with_suffix(".py").read_bytes())
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


METHODS = {"update", "locate"}  # of a SLAM, and of a guest
_KINDS = ("Slam", "Guest")  # ends of the names of classes to inherit from


def code_meant(name: str) -> list[str]:
    """For ``my_slam``, ``my_slam.py`` or ``my_slam.MySlam``: ``my_slam:MySlam`` for each class of a
    file of that name, where modules are found (``look_in``), that looks like a SLAM.

    The file is read and not run.
    """
    module = name.partition(":")[0].removeprefix("./").removesuffix(".py")
    for folder, stem in product(_wanted, (module, module.rpartition(".")[0])):
        path = Path(folder, f"{stem}.py")
        if stem.isidentifier() and path.is_file():
            return [f"{stem}:{one}" for one in _classes_with(METHODS, path)]
    return []


def _classes_with(methods: Set[str], path: Path) -> list[str]:
    """Names of the classes in a file that define one of these or inherit it, by their names; none
    of a file that is no Python."""
    found: list[str] = []
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return found
    for one in (node for node in tree.body if isinstance(node, ast.ClassDef)):
        own = {of.name for of in one.body if isinstance(of, ast.FunctionDef)}
        above = [ast.unparse(base) for base in one.bases]
        if own & methods or any(base in found or base.endswith(_KINDS) for base in above):
            found.append(one.name)
    return found
