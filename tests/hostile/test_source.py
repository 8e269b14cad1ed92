# SPDX-License-Identifier: Apache-2.0
"""Nothing in the source can make code of what it reads."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.fuzz
REPO = Path(__file__).resolve().parents[2]
SOURCES = {
    path.relative_to(REPO).as_posix(): path.read_text()
    for package in ("slam", "sim", "scenes", "scripts")
    for path in sorted((REPO / package).rglob("*.py"))
}
# Of ``np.load`` no word on pickle has it off (NumPy 1.16.3 and later).
CODE = re.compile(
    r"^ *(?:import|from) (pickle|dill|cloudpickle|marshal|shelve|yaml|runpy|code)\b"
    r"|(?<![.\w`])(?<!def )(eval|exec|compile|__import__)\("
    r"|\b(joblib\.(?:load|dump|Memory)|os\.(?:system|popen)|yaml\.load)\("
    r"|\b(allow_pickle|shell)=(?!False\b)",
    re.MULTILINE,
)
# the only places where a word becomes a module; each has its reason
IMPORTERS = {
    "slam/system.py": "module:Class, refused for names from files",
    "slam/names.py": "--with MODULE, the same",
    "scenes/registry.py": "module:function, the same",
    "slam/__init__.py": "public names, by constants",
    "scenes/__init__.py": "the same",
    "sim/sensors/lidar/registry.py": "scanner models of ours, by their files",
    "slam/errors.py": "packages of extras, by constants",
    "sim/gym/offline.py": "Minari, by constants",
    "sim/view/camera.py": "the GL libraries, by constants",
    "scripts/workers.py": "Dask",
    "scripts/benches/against.py": "ir-sim, by a constant",
    "scripts/exports.py": "pyarrow, by constants",
    "scripts/spec.py": "names to complete, by constants",
    "slam/ros/link.py": "the two middlewares, by constants",
    "slam/settings.py": "homes of constants, by constants",
    "scripts/live/served.py": "viser, and what its messages are read with, by constants",
    "scripts/live/replay.py": "the same",
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


def found(text: str) -> list[str]:
    """What of it makes objects or code."""
    return ["".join(groups) for groups in CODE.findall(text)]


def test_no_reader_makes_objects_or_code():
    assert {path: words for path, text in SOURCES.items() if (words := found(text))} == PRIVATE


@pytest.mark.parametrize(
    ("word", "known"), [("import_module", IMPORTERS), ("subprocess", STARTERS)]
)
def test_words_become_modules_and_processes_only_where_it_is_known(word, known):
    used = re.compile(rf"\b(?:import |importlib\.|from ){word}\b|\b{word}\(")
    assert {path for path, text in SOURCES.items() if used.search(text)} == set(known)


@pytest.mark.parametrize(
    "line",
    ["import pickle", "from yaml import load", "np.load(f, allow_pickle=True)", "eval(text)",
     "np.load(f, allow_pickle=trust)", "joblib.load(path)", "subprocess.run(x, shell=True)"],
)  # fmt: skip
def test_the_search_finds(line: str):
    assert found(line)
