# SPDX-License-Identifier: Apache-2.0
"""The recipe of an episode: about 1 KB from which the same bytes can be made again."""

import hashlib
import inspect
import json
import os
import platform
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct

from scenes import is_file
from scenes.crowd import crowd_of
from scenes.scene_file import located, sha256_of
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.core.versions import WORLD, world_of
from sim.sensors.lidar.registry import ScannerConfig, scanner_of, written
from sim.sensors.odometry.config import PRESETS
from sim.simulation import Simulation, checked_moment
from sim.twins.twins import TWINS
from sim.world.kidnapping import Kidnapping
from sim.world.robots import places_of, robot_of
from sim.world.script import cues_of
from sim.world.times_of_day import checked
from sim.world.world import World
from slam.bounded import json_of
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.files import write_text
from slam.names import NameFromFile
from slam.shaped import one_of, shaped, within

RECIPE = "recipe.json"
SCHEMA = 1
MAX_BYTES = 1 << 16
MAX_SECONDS = 86_400.0
Seconds = Annotated[float, Meta(gt=0.0, le=MAX_SECONDS)]
_AXES = ("motion", "change")
# Added since the first recipes: without a word where they are None.
_LATER = (*_AXES, "session", "moving_share", "change_at_s", "kidnap_every_s", "events", "robot",
          "scene_sha256", "also_at")  # fmt: skip
# Words for some of these in the name of an episode.
_WORDS = {"share": "moving_share", "at": "change_at_s", "kidnap": "kidnap_every_s"}
_DEPENDENCIES = ("mobilia", "mujoco", "numpy", "numba", "llvmlite", "scipy", "rosbags")


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What decides an episode.

    scene       registered name or ``module:function``; ``options`` of it, e.g. n_chairs, and
                ``scan_height_m`` and ``crowd``, but nothing that ``Simulation`` or ``Recipe`` has
                a name for
    seed        whole number >= 0
    dynamism    number in [0, 1]
    motion, change  one of its two axes alone, in [0, 1]; None: as dynamism says
    seconds     of driving
    scanner     registered name, and which errors: "utm30lx:noise" (``sim.sensors.lidar.registry``);
                "full", "noise" and "ideal" are those of the LMS-221
    resolution_deg, range_mode  of the LMS-221 (``Lms221Config``)
    odometry    preset of the wheel encoders
    twin        "", or which one of a drive's three versions (``sim.twins.twins``)
    change      in [0, 1]: share of what is out of sight that is found elsewhere later
                (``sim.actors.rearranging``); None: as the simulation has it
    session     number of a session of the same building (``sim.world.sessions``), ``change`` then
                being the share that stands elsewhere than in the session before; None: no sessions
    moving_share  in [0, 1]: of chairs and loads, on the move at any time; None: as motion says
    change_at_s  the one moment, s, at which things out of sight are put elsewhere; None: all along
    kidnap_every_s  s after which the robot is carried elsewhere, again and again; None: never
    events      what happens at stated times (``sim.world.script``); None: nothing
    robot       tables of another robot than the scene's (``sim.world.robots``); None: its own
    scene_sha256  of the files of a scene by its file (``scenes.scene_file``), found where it is not
                given; None: of another, or not known
    also_at     places of further scanners like the first on the robot (``sim.world.robots.Place``);
                None: it has one
    """

    scene: str
    seed: int
    dynamism: float
    seconds: float
    scanner: str = "full"
    resolution_deg: float = 0.5
    range_mode: str = "80m"
    odometry: str = "pioneer3dx"
    twin: str = ""
    motion: float | None = None
    change: float | None = None
    session: int | None = None
    moving_share: float | None = None
    change_at_s: float | None = None
    kidnap_every_s: float | None = None
    events: Sequence[Mapping[str, Any]] | None = None
    robot: Mapping[str, Any] | None = None
    scene_sha256: str | None = None
    also_at: Sequence[Mapping[str, float]] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.scene, str) or not self.scene:
            raise InvalidValueError(f"Recipe.scene must be a name, got {self.scene!r}")
        if self.scene_sha256 is None and not isinstance(self.scene, NameFromFile):
            object.__setattr__(self, "scene_sha256", sha256_of(self.scene))
        Seeds(self.seed)
        rates = Dynamism.at(self.dynamism)
        Dynamism.of(rates, self.moving_share, motion=self.motion, change=self.change)
        shaped("Recipe.seconds", self.seconds, Seconds)
        one_of("Recipe.odometry", self.odometry, tuple(PRESETS))
        if self.twin != "":
            one_of("Recipe.twin", self.twin, TWINS)
        self._check_change()
        if not isinstance(self.options, Mapping):
            raise InvalidValueError(f"Recipe.options must be a mapping, got {self.options!r}")
        taken = sorted(_NOT_OPTIONS.intersection(self.options))
        if taken:
            raise InvalidValueError(
                f"Recipe.options are of the scene: {taken[0]!r} is none, it would override the "
                f"recipe's own, got {self.options[taken[0]]!r}"
            )
        if "crowd" in self.options:
            crowd_of(self.options["crowd"])
        self.laser()

    def _check_change(self) -> None:
        if self.change is not None:
            within("Recipe.change", self.change, 0.0, 1.0)
        checked_moment(self.change_at_s, self.session)
        if self.kidnap_every_s is not None:
            Kidnapping(self.kidnap_every_s, Seeds(self.seed))
        if self.robot is not None:
            robot_of(self.robot)
        if self.events is not None:
            cues_of(self.events)
        if self.session is not None:
            checked(self.session)
        if self.also_at is not None:
            places_of(self.also_at)
        for name in ("kidnap_every_s", "events", "session", "also_at") if self.twin else ():
            if getattr(self, name) is not None:
                raise InvalidValueError(f"Recipe.{name} and twin exclude each other: {self.twin}")

    @property
    def share_changed(self) -> float:
        """Of things out of sight, or from one session to the next: ``change``, else dynamism."""
        return float(self.dynamism if self.change is None else self.change)

    @property
    def rearranges(self) -> bool:
        """Whether things are put elsewhere during the episode, and written down."""
        return self.session is None and self.twin in ("", TWINS[0]) and self.share_changed > 0.0

    def laser(self) -> ScannerConfig:
        """How the scanner is set."""
        if not isinstance(self.scanner, str):
            raise InvalidValueError(f"Recipe.scanner must be a name, got {self.scanner!r:.80}")
        return scanner_of(self.scanner, **self._set_on_it())

    @property
    def laser_name(self) -> str:
        """``laser`` in writing: ``lms221(range_mode=8m):noise``."""
        return written(self.scanner, **self._set_on_it())

    def _set_on_it(self) -> dict[str, Any]:
        own = {n: getattr(self, n) for n in ("resolution_deg", "range_mode")}
        return {n: v for n, v in own.items() if v != getattr(Recipe, n)}

    def simulation(self) -> dict[str, Any]:
        """Arguments of ``Simulation``."""
        more = {name: getattr(self, name) for name in _LATER if getattr(self, name) is not None}
        return {
            "scene": located(self.scene),
            "seed": self.seed,
            "dynamism": self.dynamism,
            "laser": self.laser(),
            "odometry": self.odometry,
            "labels": True,
            **more,
            **self.options,
        }

    def of_twin(self, twin: str) -> "Recipe":
        """The same for another version of its drive."""
        return replace(self, twin=twin)

    @property
    def name(self) -> str:
        """Of the episode's folder: ``office-d0.5-m0.2-c0-s0001``; at the end the twin's name.

        ``-m`` is motion and ``-c`` change, where they are given; so are ``-share`` for
        ``moving_share``, ``-at`` for ``change_at_s`` and ``-kidnap`` for ``kidnap_every_s``, and
        ``-events`` with a checksum of them.
        """
        scene = Path(self.scene).name if is_file(self.scene) else self.scene
        scene = re.sub(r"[^A-Za-z0-9_.]+", "-", scene).strip("-.")
        twin = f"-{self.twin}" if self.twin else ""
        session = "" if self.session is None else f"-session{self.session:02d}"
        levels = [(axis[0], getattr(self, axis)) for axis in ("dynamism", *_AXES)]
        level = "".join(f"-{letter}{at:.4g}" for letter, at in levels if at is not None)
        more = [(word, getattr(self, field)) for word, field in _WORDS.items()]
        level += "".join(f"-{word}{at:.9g}" for word, at in more if at is not None)
        if self.robot is not None:
            level += "-" + re.sub(r"[^A-Za-z0-9]+", "-", self.robot["name"])
        if self.events is not None:
            level += f"-events{zlib.crc32(json.dumps(self.events, sort_keys=True).encode()):08x}"
        return f"{scene}{level}-s{self.seed:04d}{session}{twin}"

    def words(self) -> dict[str, Any]:
        """As it is written; what was added since the first recipes has no word where it is None."""
        return {k: v for k, v in asdict(self).items() if k not in _LATER or v is not None}

    @property
    def sha256(self) -> str:
        """Of everything that decides the episode, whoever makes it."""
        text = json.dumps({"schema": SCHEMA, **self.words()}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


# What every recipe or simulation has: as an option it would silently replace that.
_NOT_OPTIONS = frozenset(
    {
        "name",  # of the scene, for ``scenes.build``
        *(field.name for field in fields(Recipe)),
        *inspect.signature(Simulation).parameters,
        *inspect.signature(World).parameters,
    }
)


def made_with() -> dict[str, Any]:
    """Everything about this machine that can change a bit: versions, and what its CPU can do."""
    versions = {}
    for name in _DEPENDENCIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    numpy: Any = np.show_config(mode="dicts")
    found = sorted(numpy["SIMD Extensions"].get("found", ()))
    disabled = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").replace(",", " ").split()
    return {
        "versions": versions,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libc": "-".join(platform.libc_ver()),
        "cpu": " ".join(name for name in found if name not in disabled),
    }


def write_recipe(path: Path, recipe: Recipe, result: Mapping[str, Any]) -> None:
    """``result``: what came out, the hash of the messages among it."""
    text = {
        "schema": SCHEMA,
        "world": WORLD,
        "recipe": recipe.words(),
        "recipe_sha256": recipe.sha256,
        "made_with": made_with(),
        "result": dict(result),
    }
    write_text(path, json.dumps(text, indent=1, sort_keys=True, allow_nan=False) + "\n")


@dataclass(frozen=True, kw_only=True)
class Made:
    """A recipe that was carried out: by whom, what came out, in which version of the world."""

    recipe: Recipe
    made_with: Mapping[str, Any]
    result: Mapping[str, Any]
    world: int = WORLD

    def elsewhere(self) -> str:
        """What is different here, in words; empty on the same versions and CPU."""
        here, there = made_with(), self.made_with
        changes = []
        for name in ("python", "machine", "libc", "cpu"):
            if here[name] != there.get(name):
                changes.append(f"{name} {there.get(name)} then, {here[name]} now")
        then = there.get("versions")
        then = then if isinstance(then, Mapping) else {}
        for name, version in here["versions"].items():
            if version != then.get(name):
                changes.append(f"{name} {then.get(name)} then, {version} now")
        return "; ".join(changes)


class _File(Struct):
    schema: Literal[1]
    recipe: dict[str, Any]
    recipe_sha256: str
    made_with: dict[str, Any]
    result: dict[str, Any]


def read_recipe(path: Path) -> Made:
    """Inverse of ``write_recipe``; ``LogFormatError`` that names the file for anything else.

    The scene's name is one from a file: no code runs by it (``slam.names``). The recipe may be of
    another version of the world: ``sim.core.versions.check_world`` before it is simulated.
    """
    data = json_of(path, MAX_BYTES, "recipe")
    try:
        file: _File = shaped("", data, _File)
        own = file.recipe
        if unknown := sorted(set(own) - {f.name for f in fields(Recipe)}):
            raise InvalidValueError(f"unknown key {unknown[0]!r} in the recipe")
        if isinstance(own.get("scene"), str):
            own["scene"] = NameFromFile(own["scene"], path)
        recipe = Recipe(**own)
    except (InvalidValueError, UnknownNameError, TypeError) as error:
        raise LogFormatError(path, f"no recipe: {error}") from error
    if recipe.sha256 != file.recipe_sha256:
        raise LogFormatError(path, "damaged: recipe_sha256 is not that of the recipe")
    world = world_of(path, data)
    return Made(recipe=recipe, made_with=file.made_with, result=file.result, world=world)
