# SPDX-License-Identifier: Apache-2.0
"""Nothing in the source can make code of what it reads."""

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.fuzz
REPO = Path(__file__).resolve().parents[2]
MODULES = {"pickle", "dill", "cloudpickle", "marshal", "shelve", "yaml", "runpy", "code"}
CALLS = {"eval", "exec", "compile", "__import__", "joblib.load", "joblib.dump", "joblib.Memory",
         "os.system", "os.popen", "yaml.load"}  # fmt: skip
# the only places where a word becomes a module; each has its reason
IMPORTERS = {
    "slam/system.py": "module:Class, refused for names from files",
    "slam/names.py": "--with MODULE, the same",
    "scenes/registry.py": "module:function, the same",
    "slam/__init__.py": "public names, by constants",
    "scenes/__init__.py": "the same",
    "sim/sensors/lidar/registry.py": "scanner models of ours, by their files",
    "slam/guests/guest.py": "the two guests, by constants",
    "sim/view/camera.py": "the GL libraries, by constants",
    "scripts/workers.py": "Dask",
    "scripts/benches/against.py": "ir-sim, by a constant",
    "scripts/cli.py": "verbs of ours, by constants",
    "scripts/option_names.py": "names to complete, by constants",
    "slam/ros/link.py": "the two middlewares, by constants",
    "slam/settings.py": "homes of constants, by constants",
    "scripts/live/served.py": "viser, and what its messages are read with, by constants",
    "scripts/live/replay.py": "the same",
    "scripts/live/page.py": "the same",
    "scripts/verbs/reproduce.py": "experiments of ours",
}
PRIVATE = {  # both ends are ours, over a socket that nobody else has
    "sim/gym/workers.py": ["pickle"],  # settings and functions of who makes the rooms
}
STARTERS = {
    "slam/guests/guard.py": "pipe:COMMAND, as wire.py says it",
    "slam/guests/wire.py": "a guard of ours; below it pipe:COMMAND, not of names from files",
    "sim/gym/workers.py": "our own Python, which steps some of the rooms",
    "sim/view/gl.py": "our own Python, without the working folder",
    "scripts/film/encode.py": "ffmpeg",
    "scripts/experiments/real_logs.py": "our own Python in each checkout, and git",
    "scripts/result_files.py": "git, for the commit of a results file",
}


@cache
def sources() -> Mapping[str, Sequence[ast.AST]]:
    """All nodes of every file."""
    return {
        path.relative_to(REPO).as_posix(): list(ast.walk(ast.parse(path.read_bytes())))
        for package in ("slam", "sim", "scenes", "scripts")
        for path in sorted((REPO / package).rglob("*.py"))
    }


def faults(nodes: Iterable[ast.AST]) -> Iterator[str]:
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.partition(".")[0] in MODULES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in MODULES:
            yield f"from {node.module}"
        elif isinstance(node, ast.Call):
            name = called(node.func)
            if name in CALLS:
                yield name
            for keyword in node.keywords:
                off = isinstance(keyword.value, ast.Constant) and keyword.value.value is False
                if (keyword.arg, off) == ("allow_pickle", False):
                    yield f"{name} with pickle"
                if keyword.arg == "shell" and not off:
                    yield f"{name} with a shell"


def called(function: ast.expr) -> str:
    """``f`` or ``a.f``."""
    if isinstance(function, ast.Attribute):
        return f"{getattr(function.value, 'id', '')}.{function.attr}"
    return getattr(function, "id", "")


def users_of(word: str) -> set[str]:
    fields = ("attr", "id", "name", "module")
    return {
        path for path, nodes in sources().items()
        if any(getattr(node, field, None) == word for node in nodes for field in fields)
    }  # fmt: skip


def test_no_reader_makes_objects_or_code():
    """``np.load`` without a word on pickle has it off (NumPy 1.16.3 and later)."""
    assert {
        path: found for path, nodes in sources().items() if (found := list(faults(nodes)))
    } == PRIVATE


def test_words_become_modules_and_processes_only_where_it_is_known():
    assert users_of("import_module") == set(IMPORTERS)
    assert users_of("subprocess") == set(STARTERS)


@pytest.mark.parametrize(
    "line",
    ["import pickle", "from yaml import load", "np.load(f, allow_pickle=True)", "eval(text)",
     "np.load(f, allow_pickle=trust)", "joblib.load(path)", "subprocess.run(x, shell=True)"],
)  # fmt: skip
def test_the_search_finds(line: str):
    assert list(faults(ast.walk(ast.parse(line))))
