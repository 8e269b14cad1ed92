# SPDX-License-Identifier: Apache-2.0
"""The page: what each part of the template is given, and the one file that comes out."""

import math
from pathlib import Path
from typing import Any

from scripts.comparison.plan import Run
from scripts.comparison.rules import LEVEL
from scripts.comparison.schema import LATER, NOT_ASKED, settings
from scripts.figures import color_of, glyph
from scripts.metrics.table import CURVES, EXPLAINED, METRICS, PAIRED, Section, of_section
from scripts.pages.page import template
from scripts.pages.table import Table
from scripts.report import answer, curves, pictures, score_tables, tables
from scripts.report.study import LEAST_RUNS, Study
from scripts.spec import command_line
from sim.recording.sums import add_to_sums
from slam.files import write_text
from slam.names import is_code

REPORT = "report.html"
LOST = ("lost",)
ANSWERED = ("finished", *LOST)  # how a run ends in which nothing failed


def write(study: Study) -> Path:
    """Write ``report.html`` into the comparison's folder; its path."""
    path = study.compared.folder / REPORT
    write_text(path, render(study))
    add_to_sums(path)
    return path


def render(study: Study) -> str:
    """The page as text: everything is in it, it asks for nothing."""
    slams = study.slams
    scenes = [_scene(study, scene) for scene in study.scenes]  # first: these read the runs
    many = len(study.levels) > 1  # of one there is no curve and no growth
    pairs = study.measures(PAIRED)
    return template("page.html", Path(__file__).parent).render(
        study=study,
        marks={slam: (glyph(slam, slams), color_of(slam, slams)) for slam in slams},
        settings=study.compared.settings,
        answers=answers(study),
        controls=_controls(study),
        failures=answer.failed(study.compared.runs, study.axis),
        growth=[(scene, tables.growth(study, scene)) for scene in study.scenes if many],
        least=LEAST_RUNS,
        curves=[
            (scene, [(m.name, curves.curve(study, scene, m)) for m in study.measures(CURVES)])
            for scene in study.scenes if many
        ],
        differences=[(scene, tables.of_pairs(study, scene, pairs)) for scene in study.scenes],
        outcomes=tables.of_outcomes(study),
        honesty=_levels(study, "honesty"),
        costs=tables.costs(study, study.measures(of_section("costs"))),
        maps=_levels(study, "maps"),
        days=[
            (score_tables.where(group), score_tables.sentences(own), score_tables.table(own))
            for group, own in score_tables.groups(study.compared.ages).items()
        ],
        scenes=scenes,
        numbers=_levels(study, "errors"),
        measures=study.measures(metric.key for metric in EXPLAINED),
        recipe=_recipe(study),
    )  # fmt: skip


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


def command_for(verb: str, study: Study, row: dict[str, Any], folder: str = "FOLDER") -> str:
    """``blame`` or ``shrink`` of the run of a row; ``folder``: the comparison's."""
    run = Run(scene=row["scene"], dynamism=row["dynamism"], seed=int(row["seed"]), axis=study.axis)
    path, trust = f"{folder}/runs/{run.name}.npz", is_code(run.scene)
    return command_line(verb, folder=path, slam=row["slam"], trust=trust)


def _levels(study: Study, section: Section) -> list[tuple[str, list[Table]]]:
    """For each scene the tables of those measures that are there."""
    found = [METRICS[key] for key in of_section(section)]
    groups = [(scene, tables.of_levels(study, scene, found)) for scene in study.scenes]
    return [(scene, made) for scene, made in groups if made]


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
        "blame": [command_for("blame", study, r) for r in study.worst(scene, subject, ANSWERED)],
        "shrink": [command_for("shrink", study, r) for r in study.worst(scene, subject, LOST)[:1]],
        "said": _worst_in_words(worst[0], study.axis),
        "errors": pictures.errors(run, study.slams),
        "strip": pictures.strip(run, subject, study.slams),
    }


def _worst_in_words(row: dict[str, Any], axis: str) -> str:
    ate = METRICS["ate_unaligned_m"]
    words = f"{axis} {row['dynamism']:g}, seed {row['seed']:g}: {row['outcome']}"
    if row[ate.key] is not None and math.isfinite(row[ate.key]):
        words += f", position error {ate.show(row[ate.key])} cm"
    if row["lost_at_s"] is not None:
        words += f", lost at {row['lost_at_s']:.1f} s"
    return words + "."


def for_worst(verb: str, study: Study) -> list[str]:
    """The command for the worst lost run of the subject in each scene."""
    return [
        command_for(verb, study, row, str(study.compared.folder))
        for scene in study.scenes
        for row in study.worst(scene, study.subject, LOST)[:1]
    ]


def _recipe(study: Study) -> dict[str, Any]:
    """What it takes to make the same folder again."""
    recipe = study.compared.recipe
    told = study.compared.settings
    known = {**settings(study.axis), **LATER}
    return {
        "command": _command(study),
        "versions": recipe["versions"],
        "machine": told["machine"],
        "rest": {
            key: value
            for key, value in told.items()
            if key in known and key not in ("machine", "slams", "scenes", "levels", "seeds")
        },
    }


def _command(study: Study) -> str:
    """The command line that asks for this comparison, or for this track of a benchmark."""
    told = study.compared.settings
    seeds, slams = told["seeds"], told["slams"]
    if study.axis == LEVEL:
        contestants = [slam for slam in slams if not answer.is_control(slam)]
        return command_line(
            "benchmark", tracks=study.compared.folder.resolve().name, slam=contestants or slams,
            quick=len(told["levels"]) == 3, train=seeds[0] == 0, seeds=len(seeds),
            seconds=told["seconds"], out="FOLDER",
        )  # fmt: skip
    levels = {told.get("axis", "dynamism"): told["levels"]}
    knobs = {name: told.get(name) for name in LATER if name not in NOT_ASKED}
    named = ("seconds", "every", "scanner")
    return command_line(
        "compare", slam=slams, scene=told["scenes"], **{**knobs, **levels}, seeds=len(seeds),
        first_seed=seeds[0], **{name: told[name] for name in named},
        scan_limit=told["scan_limit_s"], out="FOLDER",
    )  # fmt: skip
