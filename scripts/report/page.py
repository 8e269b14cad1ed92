# SPDX-License-Identifier: Apache-2.0
"""The page: what each part of the template is given, and the one file that comes out."""

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.closed_loop.tables import Driven
from scripts.comparison.plan import Run
from scripts.comparison.schema import LATER, settings
from scripts.metrics.table import CURVES, EXPLAINED, METRICS, PAIRED, of_section
from scripts.pages.page import Cell, Table, template
from scripts.report import answer, curves, pictures, score_tables, tables
from scripts.report.study import LEAST_RUNS, Study
from sim.recording.sums import add_to_sums
from slam.files import write_text

REPORT = "report.html"
ANSWERED = ("finished", "lost")  # how a run ends in which nothing failed


def write(study: Study, drives: Sequence[Driven] = ()) -> Path:
    """Write ``report.html`` into the comparison's folder; its path."""
    path = study.compared.folder / REPORT
    write_text(path, render(study, drives))
    add_to_sums(path)
    return path


def render(study: Study, drives: Sequence[Driven] = ()) -> str:
    """The page as text: everything is in it, it asks for nothing."""
    slams = list(dict.fromkeys([*study.slams, *(s for drive in drives for s in drive.slams)]))
    scenes = [_scene(study, scene) for scene in study.scenes]  # first: these read the runs
    return template("page.html", Path(__file__).parent).render(
        study=study,
        marks={slam: (curves.glyph(slam, slams), curves.color(slam, slams)) for slam in slams},
        drives=[(drive, curves.of_drive(drive, slams), tables.of_drive(drive)) for drive in drives],
        settings=study.compared.settings,
        answers=answers(study),
        controls=_controls(study),
        failures=answer.failed(study.compared.runs, study.axis),
        growth=[]
        if len(study.levels) == 1
        else [(scene, tables.growth(study, scene)) for scene in study.scenes],
        least=LEAST_RUNS,
        curves=_curves(study),
        differences=_differences(study),
        outcomes=tables.of_outcomes(study),
        honesty=_levels(study, of_section("honesty")),
        costs=tables.costs(study, of_section("costs")),
        maps=_levels(study, of_section("maps")),
        days=_days(study),
        scenes=scenes,
        numbers=_levels(study, of_section("errors")),
        measures=[metric for metric in EXPLAINED if study.has(metric.key)],
        recipe=_recipe(study),
    )


def answers(study: Study) -> list[str]:
    """The sentence of each scene, names in backticks; the same one only once."""
    said = [answer.answer(one) for one in _standings(study)]
    return list(dict.fromkeys(said))


def _controls(study: Study) -> list[str]:
    """A line for each scene, or one for all where they say the same; none of too few runs."""
    if study.few:
        return []
    said = {one.scene: " ".join(answer.controls(one)) for one in _standings(study)}
    if len(set(said.values())) == 1:
        return [line for line in said.values() if line][:1]
    return [f"{scene}: {line}" for scene, line in said.items() if line]


def _standings(study: Study) -> list[answer.Standing]:
    runs = study.compared.runs
    return [answer.standing(runs, study.subject, scene, study.axis) for scene in study.scenes]


def blame_command(study: Study, row: dict[str, Any], folder: str = "FOLDER") -> str:
    """What to type to learn which mover misled the SLAM of a row; ``folder``: the comparison's."""
    run = Run(scene=row["scene"], dynamism=row["dynamism"], seed=int(row["seed"]), axis=study.axis)
    path = f"{folder}/runs/{run.name}.npz"
    return shlex.join(["mobilia", "blame", path, "--slam", str(row["slam"])])


def _there(study: Study, keys: Iterable[str]) -> list[str]:
    return [key for key in keys if study.has(key)]


def _curves(study: Study) -> list[tuple[str, list[tuple[str, str]]]]:
    """For each scene (name of the metric, SVG); none of a single level, which is no curve."""
    if len(study.levels) == 1:
        return []
    return [
        (
            scene,
            [(METRICS[key].name, curves.curve(study, scene, key)) for key in _there(study, CURVES)],
        )
        for scene in study.scenes
    ]


def _differences(study: Study) -> list[tuple[str, list[Table]]]:
    """For each scene the tables of the subject against everybody."""
    found = [METRICS[key] for key in _there(study, PAIRED)]
    return [(scene, tables.of_pairs(study, scene, found)) for scene in study.scenes]


def _levels(study: Study, keys: Iterable[str]) -> list[tuple[str, list[Table]]]:
    """For each scene the tables of those measures that are there."""
    found = [METRICS[key] for key in keys]
    groups = [(scene, tables.of_levels(study, scene, found)) for scene in study.scenes]
    return [(scene, made) for scene, made in groups if made]


def _days(study: Study) -> list[tuple[str, list[str], Table]]:
    """Of the buildings of each scene and level: where, a sentence a SLAM, and the table."""
    return [
        (score_tables.where(group), score_tables.sentences(own), _scores(own))
        for group, own in score_tables.groups(study.compared.ages).items()
    ]


def _scores(rows: Sequence[Mapping[str, Any]]) -> Table:
    names = score_tables.slams_of(rows)
    lines = [
        [Cell(text=heading), *(Cell(text=text, small=small) for text, small in cells)]
        for heading, cells in score_tables.table(rows)
    ]
    caption = score_tables.size(rows)
    return Table(caption=caption, head=["score", *names], rows=lines, slams=names)


def _scene(study: Study, scene: str) -> dict[str, Any]:
    """Maps of a typical run of the subject at the highest level, and its worst runs."""
    subject = study.subject
    typical = study.typical(scene, study.levels[-1], subject)
    worst = study.worst(scene, subject)
    there, run = study.run(typical), study.run(worst[0])
    maps = pictures.map_panels(there, study.slams)
    return {
        "name": scene,
        "typical": typical,
        "maps": [maps[0], *sorted(maps[1:], key=lambda panel: panel[0] != subject)],
        "table": tables.worst(study, scene),
        "worst": worst[0],
        "blame": [blame_command(study, row) for row in study.worst(scene, subject, ANSWERED)],
        "said": _worst_in_words(worst[0], study.axis),
        "errors": pictures.errors(run, study.slams),
        "strip": pictures.strip(run, subject, study.slams),
    }


def _worst_in_words(row: dict[str, Any], axis: str) -> str:
    ate = METRICS["ate_unaligned_m"]
    words_ = f"{axis} {row['dynamism']:g}, seed {row['seed']:g}: {row['outcome']}"
    if row["ate_unaligned_m"] is not None and math.isfinite(row["ate_unaligned_m"]):
        words_ += f", position error {ate.show(row['ate_unaligned_m'])} cm"
    if row["lost_at_s"] is not None:
        words_ += f", lost at {row['lost_at_s']:.1f} s"
    return words_ + "."


def blame_worst(study: Study) -> list[str]:
    """The command for the worst lost run of the subject in each scene."""
    return [
        blame_command(study, row, str(study.compared.folder))
        for scene in study.scenes
        for row in study.worst(scene, study.subject, ("lost",))[:1]
    ]


def _recipe(study: Study) -> dict[str, Any]:
    """What it takes to make the same folder again."""
    recipe = study.compared.recipe
    told = study.compared.settings
    known = {**settings(study.axis), **LATER}
    return {
        "command": _command(told),
        "versions": recipe["versions"],
        "machine": told["machine"],
        "rest": {
            key: value
            for key, value in told.items()
            if key in known and key not in ("machine", "slams", "scenes", "levels", "seeds")
        },
    }


def _command(told: dict[str, Any]) -> str:
    """The command line that asks for this comparison."""
    seeds = told["seeds"]
    words_ = ["mobilia", "compare"]
    for option, values in (("--slam", told["slams"]), ("--scene", told["scenes"])):
        words_ += [option, *map(str, values)]
    axis = told.get("axis", "dynamism")
    words_ += [f"--{axis}", *(f"{level:g}" for level in told["levels"])]
    for name in ("motion", "change", "crowd"):
        if told.get(name) is not None:
            words_ += [f"--{name}", str(told[name])]
    if told.get("sessions") is not None:
        words_ += ["--sessions", str(told["sessions"])]
    words_ += ["--seeds", str(len(seeds)), "--first-seed", str(seeds[0])]
    words_ += ["--seconds", f"{told['seconds']:g}", "--every", str(told["every"])]
    words_ += ["--scanner", told["scanner"], "--scan-limit", f"{told['scan_limit_s']:g}"]
    words_ += ["--out", "FOLDER"]
    return shlex.join(words_)
