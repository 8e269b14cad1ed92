# SPDX-License-Identifier: Apache-2.0
"""The page: what each part of the template is given, and the one file that comes out."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from scripts.metrics.table import CURVES, EXPLAINED, METRICS, PAIRED, of_section
from scripts.report import closed, curves, pictures, style, tables, words
from scripts.report.closed import Driven
from scripts.report.study import LEAST_RUNS, Study
from sim.recording.sums import add_to_sums
from slam.files import write_text

REPORT = "report.html"
TEMPLATE = Path(__file__).with_name("page.html")


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
    return _template().render(
        study=study,
        marks={slam: (style.glyph(slam, slams), style.color(slam, slams)) for slam in slams},
        drives=[(drive, closed.curves(drive, slams), closed.table(drive)) for drive in drives],
        css=TEMPLATE.with_name("page.css").read_text(encoding="utf-8"),
        settings=study.compared.recipe["settings"],
        summary=_summary(study),
        curves=_curves(study),
        differences=_differences(study),
        outcomes=[tables.of_outcomes(study, scene) for scene in study.scenes],
        messages=tables.messages(study),
        honesty=_levels(study, of_section("honesty")),
        costs=tables.costs(study, of_section("costs")),
        maps=_levels(study, of_section("maps")),
        scenes=scenes,
        numbers=_levels(study, of_section("errors")),
        measures=[metric for metric in EXPLAINED if study.has(metric.key)],
        recipe=_recipe(study),
    )


@cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["parts"] = lambda name: re.findall(r"[^:/_.]*[:/_.]?", name)[:-1]
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8"))


def _there(study: Study, keys: Iterable[str]) -> list[str]:
    return [key for key in keys if study.has(key)]


def _summary(study: Study) -> dict[str, Any]:
    return {
        "scenes": [
            (scene, words.leaders(study, scene), tables.growth(study, scene))
            for scene in study.scenes
        ],
        "beaten": words.against_ours(study, -1),
        "better": words.against_ours(study, 1),
        "failures": words.failures(study),
        "enough": study.least_runs >= LEAST_RUNS,
        "least": LEAST_RUNS,
    }


def _curves(study: Study) -> list[tuple[str, list[tuple[str, str]]]]:
    """For each scene (name of the metric, SVG)."""
    return [
        (
            scene,
            [(METRICS[key].name, curves.curve(study, scene, key)) for key in _there(study, CURVES)],
        )
        for scene in study.scenes
    ]


def _differences(study: Study) -> list[tuple[str, list[tables.Table]]]:
    """For each scene the tables of ours against everybody."""
    found = [METRICS[key] for key in _there(study, PAIRED)]
    return [
        (scene, [tables.of_pairs(study, scene, metric) for metric in found])
        for scene in study.scenes
    ]


def _levels(study: Study, keys: Iterable[str]) -> list[tuple[str, list[tables.Table]]]:
    """For each scene the tables of those measures that are there."""
    groups = []
    for scene in study.scenes:
        made = [tables.of_levels(study, scene, METRICS[key]) for key in _there(study, keys)]
        groups.append((scene, [table for table in made if table.slams]))
    return [(scene, found) for scene, found in groups if found]


def _scene(study: Study, scene: str) -> dict[str, Any]:
    """Maps of a typical run at the highest level; the worst run of ours."""
    typical = study.typical(scene, study.levels[-1], study.ours)
    worst = study.worst(scene, study.ours)
    there, run = study.run(typical), study.run(worst)
    return {
        "name": scene,
        "typical": typical,
        "maps": pictures.map_panels(there, study.slams),
        "worst": worst,
        "said": _worst_in_words(worst, study.axis),
        "errors": pictures.errors(run, study.slams),
        "strip": pictures.strip(run, study.ours, study.slams),
    }


def _worst_in_words(row: dict[str, Any], axis: str) -> str:
    ate = METRICS["ate_unaligned_m"]
    words_ = f"{axis} {row['dynamism']:g}, seed {row['seed']:g}: {row['outcome']}"
    if row["ate_unaligned_m"] is not None and math.isfinite(row["ate_unaligned_m"]):
        words_ += f", position error {ate.show(row['ate_unaligned_m'])} cm"
    if row["lost_at_s"] is not None:
        words_ += f", lost at {row['lost_at_s']:.1f} s"
    return words_ + "."


def _recipe(study: Study) -> dict[str, Any]:
    """What it takes to make the same folder again."""
    recipe = study.compared.recipe
    settings = recipe["settings"]
    return {
        "command": _command(settings),
        "versions": recipe.get("versions", {}),
        "machine": settings.get("machine", {}),
        "rest": {
            key: value
            for key, value in settings.items()
            if key not in ("machine", "slams", "scenes", "levels", "seeds")
        },
    }


def _command(settings: dict[str, Any]) -> str:
    """The command line that asks for this comparison."""
    seeds = settings["seeds"]
    words_ = ["mobilia", "compare"]
    for option, values in (("--slam", settings["slams"]), ("--scene", settings["scenes"])):
        words_ += [option, *map(str, values)]
    axis = settings.get("axis", "dynamism")
    words_ += [f"--{axis}", *(f"{level:g}" for level in settings["levels"])]
    for name in ("motion", "change", "crowd"):
        if settings.get(name) is not None:
            words_ += [f"--{name}", str(settings[name])]
    words_ += ["--seeds", str(len(seeds)), "--first-seed", str(seeds[0])]
    words_ += ["--seconds", f"{settings['seconds']:g}", "--every", str(settings["every"])]
    words_ += ["--scanner", settings["scanner"], "--scan-limit", f"{settings['scan_limit_s']:g}"]
    words_ += ["--out", "FOLDER"]
    return shlex.join(words_)
