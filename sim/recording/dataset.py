# SPDX-License-Identifier: Apache-2.0
"""A folder of episodes and the plan that they follow."""

import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from sim.core.versions import check_world
from sim.recording import MINARI
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.splits import Split, checked_split, file_of, list_text, part_of
from sim.recording.sums import SUMS, Fault, faults, foreign, read_sums, sha256, text_of
from sim.recording.tables import FILES, write_days
from sim.recording.verify import Finding, check_hashes, finding, listed_in, other_format
from sim.twins.twins import TWINS
from sim.world.times_of_day import MOST_SESSIONS
from slam import bounded, locks
from slam.errors import InvalidValueError, LogFormatError, OutputError
from slam.files import PART, is_part, make_folder, reason, write_text
from slam.shaped import instance, whole

PLAN = "dataset.json"
PAGE = "index.html"  # for who looks at it; listed where ``generate`` came as far as that
SCHEMA = 1
MAX_EPISODES = 1_000_000
MAX_BYTES = 1 << 20  # of dataset.json


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which episodes a dataset has: ``episodes`` of them in each scene at each dynamism, of the
    same seeds.

    recipe      of the first one; the k-th episode has its seed plus k
    dynamisms   numbers in [0, 1]
    twins       whether each episode is one drive in three versions
    sessions    0, or how many sessions of one building there are (``sim.world.sessions``): one
                episode each, all of one seed and one dynamism
    scenes      (), or several, that of the recipe first
    split       (), or parts by name and number of seeds, which add up to ``episodes``
                (``sim.recording.splits``)
    format      "", or what each episode is also written as (``scripts.formats``); ``MINARI``: no
                bags, but the drives of ``sim.gym.offline``
    """

    recipe: Recipe
    dynamisms: tuple[float, ...]
    episodes: int
    twins: bool = False
    sessions: int = 0
    scenes: tuple[str, ...] = ()
    split: Split = ()
    format: str = ""

    def __post_init__(self) -> None:
        whole("Plan.episodes", self.episodes, 1, MAX_EPISODES)
        instance("Plan.format", self.format, str)
        self._check_parts()
        if not self.dynamisms or len(set(self.dynamisms)) != len(self.dynamisms):
            raise InvalidValueError(
                f"Plan.dynamisms must be different numbers, got {self.dynamisms}"
            )
        self._check_sessions()
        count = self.episodes * len(self.dynamisms) * max(1, len(self.scenes))
        if count > MAX_EPISODES:
            raise InvalidValueError(f"Plan: at most {MAX_EPISODES} episodes, got {count}")
        both = self.recipe.motion is not None and self.recipe.change is not None
        if both and len(self.dynamisms) > 1:
            raise InvalidValueError(
                "Plan.dynamisms: with motion and change both given, all levels are the same"
            )
        names = [name for recipe in self.jobs() for name in self.folders(recipe)]
        if len(set(names)) != len(names):
            raise InvalidValueError("Plan: two episodes have one name (scenes, dynamisms)")

    def _check_parts(self) -> None:
        object.__setattr__(self, "scenes", tuple(self.scenes))
        object.__setattr__(self, "split", checked_split(self.split))
        scenes = self.scenes
        if scenes and (scenes[0] != self.recipe.scene or len(set(scenes)) != len(scenes)):
            raise InvalidValueError(
                f"Plan.scenes must be different, that of the recipe first, got {scenes!r:.200}"
            )
        seeds = sum(count for _, count in self.split)
        if self.split and seeds != self.episodes:
            raise InvalidValueError(
                f"Plan.split must add up to the {self.episodes} episodes, got {seeds}"
            )

    def _check_sessions(self) -> None:
        whole("Plan.sessions", self.sessions, 0, MOST_SESSIONS)
        alone = self.episodes == 1 and len(self.dynamisms) == 1 and not self.twins
        if self.sessions and not (alone and len(self.scenes) < 2 and not self.split):
            raise InvalidValueError(
                "Plan.sessions are of one building: one scene, one episode, one dynamism, no twins "
                f"and no split, got {self.scenes or self.recipe.scene}, {self.episodes}, "
                f"{self.dynamisms}, {self.twins} and {self.split}"
            )

    def jobs(self) -> list[Recipe]:
        """One recipe for each drive."""
        if self.sessions:
            (level,) = self.dynamisms
            return [replace(self.recipe, dynamism=level, session=k) for k in range(self.sessions)]
        first, twin = asdict(self.recipe), "dynamic" if self.twins else ""
        if self.scenes:
            first["scene_sha256"] = None  # each finds its own
        return [
            Recipe(
                **{**first, "scene": s, "dynamism": d, "seed": self.recipe.seed + k, "twin": twin}
            )
            for s in self.scenes or (self.recipe.scene,)
            for d in self.dynamisms
            for k in range(self.episodes)
        ]

    def folders(self, recipe: Recipe) -> list[str]:
        """Names of the episodes that a job makes."""
        return [recipe.of_twin(name).name for name in TWINS] if self.twins else [recipe.name]

    def planned(self) -> dict[str, Recipe]:
        """Every episode: folder and recipe."""
        return {
            recipe.name: recipe
            for job in self.jobs()
            for recipe in (map(job.of_twin, TWINS) if self.twins else [job])
        }

    def text(self) -> str:
        """``dataset.json``."""
        told = asdict(self) | {"recipe": self.recipe.words()}
        for name in ("sessions", "scenes", "split", "format"):  # added since the first plans
            if not told[name]:
                del told[name]
        return json.dumps({"schema": SCHEMA, **told}, indent=1, sort_keys=True) + "\n"

    @property
    def files(self) -> tuple[str, ...]:
        """What lies beside the episodes: the plan, the truth of its sessions, lists of parts."""
        return (PLAN, *(FILES if self.sessions else ()), *map(file_of, dict(self.split)))

    def parts(self) -> dict[str, list[str]]:
        """Names of the episodes of each part of the split."""
        found: dict[str, list[str]] = {name: [] for name, _ in self.split}
        if self.split:
            for job in self.jobs():
                part = part_of(self.split, job.seed - self.recipe.seed)
                found[part] += self.folders(job)
        return found


class Dataset:
    """The folder ``path``; made by ``writing``."""

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self.plan = path, plan

    def missing(self) -> tuple[list[Recipe], list[str]]:
        """Jobs not done yet, and why whole-looking folders among them are not kept.

        Raises ``WorldVersionError`` for episodes of another version of the world, ``OutputError``
        for those of another format of bags: one dataset has one.
        """
        wanted, notes = [], []
        for job in self.plan.jobs():
            whole = True
            for name in self.plan.folders(job):
                folder = self.path / name
                if not os.path.lexists(folder):
                    whole = False
                    continue
                found = check_hashes(folder)
                if found.verdict == "whole":
                    made = read_recipe(folder / RECIPE)
                    check_world(folder / RECIPE, made.world)
                    if why := other_format(made):
                        raise OutputError(f"{folder}: {why}: choose another --out")
                elif found.verdict == "foreign":
                    notes.append(f"left as it is: {found.why}")
                else:
                    if found.foreign:
                        raise OutputError(f"move away what is not ours, to go on: {found.why}")
                    whole = False
                    notes.append(f"made again: {found.why}")
                    shutil.rmtree(folder)
            if not whole:
                wanted.append(job)
        return wanted, notes

    def finish(self) -> None:
        """Write the truth of sessions and the lists of parts, and vouch for all; raises as that."""
        if self.plan.sessions:
            write_days(self.path, self.plan.recipe, self.plan.sessions)
        for part, names in self.plan.parts().items():
            write_text(self.path / file_of(part), list_text(names))
        self.vouch(self.plan.files, self.plan.planned())

    def vouch(self, files: Iterable[str], folders: Iterable[str]) -> None:
        """Write SHA256SUMS over these files and all that the SHA256SUMS of the folders list, so
        that damage is never listed as sound; ``OutputError`` when one is missing."""
        sums = {name: sha256(self.path / name) for name in files}
        for name in folders:
            try:
                sums |= _sums_of(self.path / name)
            except LogFormatError as error:
                raise OutputError(f"{self.path / name} is not there: {error}") from error
        write_text(self.path / SUMS, text_of(sums))


def _sums_of(episode: Path) -> dict[str, str]:
    """What the dataset's SHA256SUMS says of an episode."""
    sums = {f"{episode.name}/{file}": digest for file, digest in read_sums(episode).items()}
    return sums | {f"{episode.name}/{SUMS}": sha256(episode / SUMS)}


def read_plan(path: Path) -> Plan:
    """``dataset.json`` of the dataset ``path``, byte by byte as ``generate`` writes it.

    Raises ``LogFormatError`` for one that is missing or anything else.
    """
    file = path / PLAN
    text = bounded.text_of(file, MAX_BYTES)
    try:
        data = json.loads(text)
        if not isinstance(data, dict) or data.pop("schema", None) != SCHEMA:
            raise LogFormatError(file, f"no plan of schema {SCHEMA}")
        levels, recipe = tuple(data.pop("dynamisms")), Recipe(**data.pop("recipe"))
        plan = Plan(recipe=recipe, dynamisms=levels, **data)
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise LogFormatError(file, f"no plan of a dataset: {error}") from error
    if plan.text() != text:
        raise LogFormatError(file, "damaged: not as it was written")
    return plan


def check_dataset(path: Path) -> list[Finding]:
    """The dataset itself, then every episode of its plan: all files against all SHA256SUMS.

    An episode that is not planned is foreign, one that is planned and not there is missing.
    """
    listed, found = listed_in(path)
    files: tuple[str, ...] = (PLAN,)
    try:
        plan = read_plan(path)
        if plan.format == MINARI:
            return [finding(path.resolve().name, [*found, *faults(path, listed, results=False)])]
        planned: Mapping[str, Recipe | None] = plan.planned()
        files = plan.files
    except LogFormatError as error:
        missing = not os.path.lexists(path / PLAN)
        found.append(Fault(kind="incomplete" if missing else "damaged", name=PLAN, why=str(error)))
        planned = dict.fromkeys(
            sorted({name.partition("/")[0] for name in listed} - {PLAN, *FILES})
        )
        files = (PLAN, *(name for name in FILES if name in listed))
    files = (*files, PAGE) if PAGE in listed else files
    for name in files:
        if name != PLAN and not os.path.lexists(path / name):
            why = f"{path / name} is missing: 'mobilia generate' as before adds it"
            found.append(Fault(kind="incomplete", name=name, why=why))
    episodes = [check_hashes(path / name, recipe) for name, recipe in planned.items()]
    if listed:
        found += _against(path, listed, files, episodes)
    found += _strangers(path, set(planned), files)
    return [finding(path.resolve().name, found), *episodes]


def _against(
    path: Path, listed: Mapping[str, str], files: Sequence[str], episodes: Sequence[Finding]
) -> list[Fault]:
    """Where the dataset's SHA256SUMS and those of the episodes do not say the same."""
    sums: dict[str, str] = {}
    for name in (*files, *(episode.episode for episode in episodes)):
        try:
            sums |= {name: sha256(path / name)} if name in files else _sums_of(path / name)
        except LogFormatError:  # told already; all that is listed of it passes
            sums |= {k: v for k, v in listed.items() if k == name or k.startswith(f"{name}/")}
    found = []
    for name in sorted(listed.keys() | sums.keys()):
        if name not in listed:
            why = f"{path / SUMS} does not list {name}: 'mobilia generate' as before adds it"
        elif name not in sums:
            why = f"{path / SUMS} lists {name}, which no episode has"
        elif sums[name] != listed[name]:
            why = f"{path / name} is damaged: it is not what {path / SUMS} says"
        else:
            continue
        found.append(Fault(kind="damaged", name=name, why=why))
    return found


def _strangers(path: Path, planned: set[str], files: Sequence[str]) -> list[Fault]:
    """What lies beside the episodes."""
    there = set(os.listdir(path)) - {*files, SUMS}
    return foreign(path, there, planned)


@contextmanager
def writing(path: Path, plan: Plan) -> Iterator[Dataset]:
    """The dataset at ``path``, locked against other writers, cleared of torn episodes.

    Raises ``OutputError`` when somebody else writes there, or workers that a killed run left still
    do, when the folder follows another plan or holds files that are no dataset, or cannot be
    written.
    """
    path = path.absolute()
    try:
        make_folder(path)
        with locks.locked(path):
            try:
                _claim(path, plan)
                _clear(path)  # of what a killed run left
                yield Dataset(path, plan)
            finally:
                _clear(path)  # of what killed workers left
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error, path)}") from error


def _clear(path: Path) -> None:
    for torn in path.glob(f".*{PART}"):
        shutil.rmtree(torn, ignore_errors=True)


def _claim(path: Path, plan: Plan) -> None:
    """Leave the plan in an empty folder."""
    refuse_others(path, plan)
    if not (path / PLAN).exists():
        write_text(path / PLAN, plan.text())


def refuse_others(path: Path, plan: Plan) -> None:
    """``OutputError`` for a folder that has another plan, or files and none."""
    file = path / PLAN
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file; --out needs a folder")
    if file.exists():
        bounded.check_file(file)
        if file.read_text(encoding="utf-8", errors="replace") != plan.text():
            raise OutputError(f"{file} is of another dataset: choose another --out")
        return
    there = os.listdir(path) if path.is_dir() else ()
    if any(name not in locks.NAMES and not is_part(name) for name in there):
        raise OutputError(f"{path} holds files that are no dataset: choose another --out")


def episodes_in(path: Path) -> list[Path]:
    """The episode at ``path``, or all episodes of the dataset there.

    Raises ``LogFormatError`` when there is neither.
    """
    if (path / "recipe.json").exists():
        return [path]
    if not path.is_dir():
        raise LogFormatError(path, "no such folder")
    found = sorted(p.parent for p in path.glob("*/recipe.json"))
    if not found:
        raise LogFormatError(path, "holds no episode (no recipe.json)")
    return found
