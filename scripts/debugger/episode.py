# SPDX-License-Identifier: Apache-2.0
"""Which run is looked at: from its folder, or from what would make it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.comparison.again import again
from scripts.comparison.run_file import RunFile
from scripts.names import file_name, is_run
from scripts.options import admitted, whole
from sim.recording.recipe import Made
from sim.recording.sums import check_vouched
from slam.errors import InvalidValueError, LogFormatError, MissingPathError
from slam.frames import Float
from slam.trajectory import read_tum

NO_OPTIONS = (
    "scene", "seed", "dynamism", "motion", "change", "crowd", "laser", "labels",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Case:
    """A simulated tour and the SLAM on it.

    settings  arguments of ``Simulation``
    seconds   of the tour
    slam      name or ``module:Class``
    every     the SLAM gets one scan in so many
    title     for people
    recorded  (n, 3) what it believed then, if that is on file
    made      who recorded it, if that is known
    """

    settings: Mapping[str, Any]
    seconds: float
    slam: str = "shunting"
    every: int = 1
    recorded: Float | None = field(default=None, repr=False)
    made: Made | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        whole("--every", self.every, 1)

    @property
    def title(self) -> str:
        """The world in a line."""
        options = {k: v for k, v in self.settings.items() if isinstance(v, str | int | float)}
        scene = options.pop("scene", "?")
        options.pop("scene_sha256", None)
        return " · ".join([str(scene), *(f"{k} {v}" for k, v in sorted(options.items()))])


def case_of(folder: Path, slam: str | None, every: int, trust: bool = False) -> Case:
    """The case of a folder of ``mobilia run`` or ``demo``, of an episode of a dataset, or of a run
    of a comparison. Raises as ``scripts.comparison.again.again``, which has ``trust``, too."""
    if not folder.exists():
        raise MissingPathError(folder, "no such folder")
    found, recorded = again(folder, trust), None
    if found.twin:
        raise LogFormatError(
            folder, f"a {found.twin} twin cannot be changed: take an episode made without --twins"
        )
    usual = "odometry" if found.slams else "shunting"
    slam = admitted(slam or found.slam or usual, "SLAM", trust)
    if is_run(folder):
        if every not in (1, found.every):
            raise InvalidValueError(
                f"--every: in this comparison SLAMs got one scan in {found.every}"
            )
        every = found.every
        recorded = RunFile(folder).believed(slam).poses if slam in found.slams else None
    elif found.made is None:
        online = (
            folder if folder.is_dir() else folder.parent
        ) / f"trajectory_{file_name(slam)}.tum"
        check_vouched(online)
        recorded = read_tum(online).poses if every == 1 and online.exists() else None
    return Case(
        settings=found.settings, seconds=found.seconds, slam=slam, every=every, recorded=recorded,
        made=found.made,
    )  # fmt: skip


def options_of(words: list[str]) -> dict[str, Any]:
    """``["walls=none", "n_chairs=6"]`` as arguments; ``InvalidValueError`` for anything else."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name.isidentifier() and equals and value):
            raise InvalidValueError(f"--option must be NAME=VALUE, got {word!r}")
        if name in NO_OPTIONS:
            raise InvalidValueError(f"--option {name}: that has an option of its own or none")
        try:
            found[name] = json.loads(value)
        except ValueError:
            found[name] = value
    return found
