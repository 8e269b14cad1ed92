# SPDX-License-Identifier: Apache-2.0
"""Names that are typed, and names of outputs: all that a verb needs before its slow imports."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from scenes import is_file, registry
from scripts.console import note
from slam import system
from slam.variants import inside

MOST_LETTERS = 120  # of a system's name in that of a file: disks take 255 in all
RUNS = "runs"  # of a comparison: the folder of its runs
DATASET = "dataset.json"  # the plan that ``generate`` writes (``sim.recording.dataset``)
# Endings of logs, which are no part of their names.
LOGS = (".gz", ".xz", ".log", ".clf", ".txt", ".mat", ".bag", ".mcap", ".db3", ".npz")


def check(slams: Sequence[str | None], *scenes: str | None) -> None:
    """``UnknownNameError`` for a SLAM or a scene of no such name; None is none.

    Names of code (``module:Class``) are resolved later, where they are used.
    """
    for scene in scenes:
        if scene is not None:
            registry.check_name(scene)
    for slam in filter(None, slams):
        system.check_name(slam)
        if inside(slam).partition(":")[0] in ("ros2", "ros2-zenoh"):
            note(f"{slam} is a node of ROS 2: its results do not repeat to the byte")


def is_run(path: Path) -> bool:
    """Whether it is where a comparison keeps a run: ``<folder>/runs/<name>.npz``."""
    return path.parent.name == RUNS and path.suffix == ".npz"


def run_name(path: Path) -> str:
    """What outputs about the run, episode or log at ``path`` are called.

    A folder's name is whole, after that of its dataset (``data-office-d0.5-s0001``); a file's is
    without the endings of logs.
    """
    path = path.resolve()
    if path.is_dir():
        of_dataset = (path.parent / DATASET).exists()
        return f"{path.parent.name}-{path.name}" if of_dataset else path.name
    while path.suffix.lower() in LOGS:
        path = path.with_suffix("")
    return path.name


def scene_name(scene: str) -> str:
    """A scene's name as part of the name of one output: of a file, the name without its folder."""
    return Path(scene).stem if is_file(scene) else file_name(scene)


def file_name(name: str) -> str:
    """A system's name as part of a file name: ``my_pkg:MySlam`` becomes ``my_pkg-MySlam``."""
    short = name if len(name) <= MOST_LETTERS else (
        f"{name[:MOST_LETTERS]}-{hashlib.sha256(name.encode()).hexdigest()[:10]}"
    )  # fmt: skip
    return "".join(c if c.isalnum() or c in "-_." else "-" for c in short).lstrip("-.")
