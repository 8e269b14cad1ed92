# SPDX-License-Identifier: Apache-2.0
"""A run on file as what would make it again: for films and counterfactuals."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from scenes.scene_file import located
from scripts.comparison.plan import Plan
from scripts.names import RUNS, is_run
from scripts.options import admitted
from scripts.output import RECIPE, check_whole, read_recipe_words, scenes_of, slams_of
from scripts.spec import command_line
from sim.core.versions import check_world, world_of
from sim.recording.recipe import Made, Recipe, read_recipe
from sim.recording.sums import check_vouched
from sim.twins.cut import WHOLE, Cut
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.shaped import shaped

OF_ONE = ("run", "demo", "shrink", None)  # commands that leave one run
# In the recipe of a run; the rest is the world's.
OF_THE_RUN = ("slams", "seconds", "simulation", "cut")
_OF_PLAN = [field.name for field in fields(Plan)]


@dataclass(frozen=True, kw_only=True)
class Again:
    """What makes a run again.

    settings  arguments of ``Simulation``, but for its labels
    seconds   of the tour
    slams     that ran, by names of a file;   cut  what they got of the tour
    twin      of an episode: which version of its drive it is;   made  who recorded it
    """

    settings: Mapping[str, Any]
    seconds: float
    slams: tuple[str, ...] = ()
    cut: Cut = WHOLE
    twin: str = ""
    made: Made | None = None

    @property
    def slam(self) -> str:
        """The one that the run was about; "" where nobody says."""
        return next((name for name in self.slams if name != "odometry"), "")

    def told(self) -> dict[str, Any]:
        """As ``scripts.film.footage.of_scene`` and the recipe of a run have it."""
        cut = {} if self.cut == WHOLE else {"cut": asdict(self.cut)}
        return {**self.settings, "seconds": self.seconds, **cut}


def again(path: Path, trust: bool = False) -> Again:
    """Of the folder of a run or an episode, or of a run of a comparison.

    trust  whether a scene that is code, by the name that a file there has, is run; the names of its
           SLAMs stay those of a file

    Raises ``LogFormatError`` that says what is missing or wrong there, ``UntrustedNameError``
    without ``trust``, ``WorldVersionError`` for a run of another version of the world.
    """
    if is_run(path):
        return run_of(path, trust)
    recipe = path / RECIPE if path.is_dir() else path
    check_vouched(recipe)  # one that is listed is lost
    if path.is_dir() and not recipe.exists():
        raise LogFormatError(path, "holds no run or episode" + _episodes_in(path))
    if path.is_file() and path.suffix != ".json":
        raise LogFormatError(path, "is no folder of a run or an episode, which have a recipe.json")
    words = read_recipe_words(recipe)
    if "recipe" in words:
        made = read_recipe(recipe)
        check_world(recipe, made.world)
        return again_of(made.recipe, trust, twin=made.recipe.twin, made=made)
    command, settings = words.get("command"), words.get("settings")
    if command not in OF_ONE:
        raise LogFormatError(recipe.parent, why_no_run(recipe.parent, command))
    if not isinstance(settings, dict):
        raise LogFormatError(recipe, "no recipe of a run: it has no settings")
    slams = tuple(slams_of(recipe, settings))
    if "log" in settings:
        slam = next((name for name in slams if name != "odometry"), None)
        film = command_line("render", folder=str(settings["log"]), slam=slam)
        why = f"this run was on a log, which is not kept in it: the film of the log is {film}"
        raise LogFormatError(recipe.parent, why)
    if "scene" not in settings or "seconds" not in settings:
        raise LogFormatError(recipe.parent, why_no_run(recipe.parent, command))
    _check_settings(recipe, settings)
    check_world(recipe, world_of(recipe, words))
    world = {key: value for key, value in settings.items() if key not in OF_THE_RUN}
    (scene,) = scenes_of(recipe, {"scene": settings["scene"]})
    world["scene"] = located(admitted(scene, "scene", trust))
    return Again(settings=world, seconds=settings["seconds"], slams=slams, cut=_cut(settings))


def _episodes_in(folder: Path) -> str:
    """What to name instead of a dataset."""
    first = min((one.parent for one in folder.glob(f"*/{RECIPE}")), default=None)
    return "" if first is None else f": name one of those in it, as {first}"


def again_of(recipe: Recipe, trust: bool = False, **more: Any) -> Again:
    """Of a recipe; ``trust`` as in ``again``, ``more`` of ``Again``."""
    settings = {key: value for key, value in recipe.simulation().items() if key != "labels"}
    settings |= {"laser": recipe.laser_name, "scene": admitted(recipe.scene, "scene", trust)}
    return Again(settings=settings, seconds=recipe.seconds, **more)


def _check_settings(path: Path, settings: Mapping[str, Any]) -> None:
    unknown = sorted({"drive", "name", "start"}.intersection(settings))
    if unknown:
        raise LogFormatError(path, f"no recipe of a run: settings.{unknown[0]} is none of them")
    if not isinstance(settings.get("laser", ""), str):
        raise LogFormatError(path, "no recipe of a run: settings.laser must be a scanner's name")
    seconds = settings["seconds"]
    if isinstance(seconds, bool) or not isinstance(seconds, int | float):
        raise LogFormatError(path, f"no recipe of a run: seconds must be a number, got {seconds!r}")
    try:
        _cut(settings)
    except InvalidValueError as error:
        raise LogFormatError(path, f"no recipe of a run: {error}") from error


def _cut(settings: Mapping[str, Any]) -> Cut:
    given, known = settings.get("cut", {}), [field.name for field in fields(Cut)]
    cut: Cut = shaped("cut", given, Cut)
    if unknown := sorted(set(given) - set(known)):
        raise InvalidValueError(f"cut has {', '.join(known)}, but no {unknown[0]!r:.80}")
    if not cut.from_s < settings["seconds"]:
        raise InvalidValueError(
            f"cut.from_s must be < {settings['seconds']:g} s, its run's end, got {cut.from_s:g}"
        )
    return cut


def run_of(path: Path, trust: bool = False) -> Again:
    """Of ``DIR/runs/NAME.npz`` of a comparison; raises as ``again``."""
    check_whole(path.parent.parent)
    recipe = path.parent.parent / RECIPE
    words = read_recipe_words(recipe)
    command, settings = words.get("command"), words.get("settings")
    if command == "drive":
        raise LogFormatError(path, why_no_run(path, command))
    if command != "compare" or not isinstance(settings, dict):
        raise LogFormatError(recipe, "no recipe of a comparison")
    check_world(recipe, world_of(recipe, words))
    try:
        settings |= {"slams": slams_of(recipe, settings), "scenes": scenes_of(recipe, settings)}
        told: dict[str, Any] = {k: settings[k] for k in _OF_PLAN if k in settings}
        told |= {k: tuple(v) for k, v in told.items() if isinstance(v, list)}
        plan = Plan(**told)
    except (TypeError, InvalidValueError, UnknownNameError, LogFormatError) as error:
        why = f"no recipe of a comparison: {getattr(error, 'message', error)}"
        raise LogFormatError(recipe, why) from error
    for run in plan.runs():
        if run.name == path.stem:
            cut = Cut(every=plan.every)
            return again_of(plan.recipe(run), trust, slams=plan.slams, cut=cut)
    raise LogFormatError(path, f"no run of that comparison, whose first is {plan.runs()[0].name}")


def why_no_run(folder: Path, command: object) -> str:
    """Why the folder of many runs is no run, and what to name instead."""
    if command == "compare":
        one = min((folder / RUNS).glob("*.npz"), default=folder / RUNS / "*.npz")
        return f"a comparison of many runs: name one of them, as {one}"
    if command == "drive":
        return (
            "made by 'mobilia drive', where each SLAM's robot went its own way: simulate the room "
            "with 'mobilia run SLAM --scene ... --dynamism ... --seed ...' and name that run"
        )
    return f"made by 'mobilia {str(command)[:40]}', which leaves no run"
