# SPDX-License-Identifier: Apache-2.0
"""A matrix of runs: cases x systems -> rows -> a table. An experiment declares one ``Study``.

Each drive that is simulated and each run over it is a job (``scripts.jobs``) in ``--folder``. A
study that was killed goes on when the same command is given again, and what other code or other
settings made is made again.
"""

import argparse
import hashlib
import importlib
import json
import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import scenes
import sim
import slam
from scripts.benchmark.tracks import chosen
from scripts.comparison.entry import scored
from scripts.comparison.recording import Recording, load, record
from scripts.comparison.tables import number
from scripts.console import ended
from scripts.imports import scripts_of, sources
from scripts.jobs import Job, run_jobs
from scripts.machine import machine, versions
from scripts.marks import fill_page, filled, table
from scripts.metrics.judged import world_truth
from scripts.metrics.table import METRICS
from scripts.names import file_name
from scripts.result_files import RESULTS, SCHEMA, commit, write
from sim.core.versions import WORLD
from sim.recording.recipe import Recipe
from slam.replay import Track
from slam.system import create

CM = 100.0
Row = dict[str, Any]
Column = Callable[[Sequence[Row]], str]


def add_options(parser: argparse.ArgumentParser, out: str, page: Path) -> None:
    """``--seeds``, ``--first-seed``, ``--seconds``, ``--jobs``, ``--results``, ``--page``."""
    parser.add_argument("--seeds", type=int, default=10, help="how many")
    add_run_options(parser, out, page)


def add_run_options(parser: argparse.ArgumentParser, out: str, page: Path) -> None:
    """The same without ``--seeds``, where these follow from something else."""
    parser.add_argument("--first-seed", type=int, default=500, help="nobody tuned on these")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each run, simulated")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--results", type=Path, default=RESULTS / out)
    parser.add_argument("--page", type=Path, default=page)
    parser.add_argument("--no-page", action="store_true", help="leave the page as it is")


def seeds_of(wanted: argparse.Namespace) -> list[int]:
    """Of the two options."""
    return list(range(wanted.first_seed, wanted.first_seed + wanted.seeds))


def head(
    wanted: argparse.Namespace,
    mark: str,
    arguments: Sequence[str] | None,
    *asked: str,
    package: str = "scripts.experiments",
) -> dict[str, Any]:
    """The head of the results file, with the options ``asked``; call it before anything is run.

    ``mark`` names the module of ``package``, and its place in the page. Of absolute paths the
    command keeps the last part: where a machine keeps them helps nobody.

    Raises ``InvalidValueError`` where the page has no such mark, or where the project's own results
    would name a commit that is not the code here; ``OSError`` for no such page.
    """
    if not wanted.no_page:
        filled(wanted.page.read_text(encoding="utf-8"), mark, "", wanted.page)
    own = wanted.results.resolve().parent == RESULTS
    given = sys.argv[1:] if arguments is None else arguments
    words = [Path(word).name if Path(word).is_absolute() else word for word in given]
    return {
        "schema": SCHEMA,
        "command": shlex.join(["python", "-m", f"{package}.{mark}", *words]),
        "commit": commit() if own else None,
        "world": WORLD,
        "machine": machine(),
        "versions": versions(),
        "seeds": seeds_of(wanted),
        "seconds": wanted.seconds,
        **{key: getattr(wanted, key) for key in asked},
    }


def judged(case: Row, drive: Recording) -> Row:
    """The run of ``case["slam"]``: each column of a comparison."""
    track, truth = Track(case["slam"], create(case["slam"])), world_truth(drive.frames)
    failure = track.survive(drive.frames)
    return scored(track, None if failure else track.final(), failure, truth)


def on_track(name: str, level: float, seed: int) -> Row:
    """Every scan of a level of a track; ``UnknownNameError`` for none, ``InvalidValueError`` for a
    level that it has not."""
    plan = chosen([name])[0].plan((), (seed,), levels=(level,))
    return asdict(plan.recipe(plan.runs()[0]))


def of(
    key: str, how: Callable[[Any], Any] = np.median, scale: float = 1.0, form: str = "{:.2f}"
) -> Column:
    """A column: ``how`` of that number over the rows that have it; of a failed run's error inf."""

    def tell(rows: Sequence[Row]) -> str:
        of_metric = key in METRICS and "outcome" in rows[0]
        found = (number(row, key) if of_metric else row.get(key) for row in rows)
        values = np.array([v for v in found if v is not None and not math.isnan(v)])
        return form.format(scale * float(how(values))) if len(values) else "–"

    return tell


def losses(rows: Sequence[Row]) -> str:
    """A column: runs lost, of how many."""
    return f"{sum(row['lost'] for row in rows)} of {len(rows)}"


def geometric(values: Sequence[float]) -> float:
    """Mean."""
    return math.exp(float(np.log(values).mean()))


RECORDINGS, ROWS = "recordings", "rows"  # folders of the jobs' files


@dataclass(frozen=True, kw_only=True)
class Study:
    """What is run, and what is told of it.

    name     of the module, of the results file, and of the mark in the page
    axes     what is varied, and its values: an option each
    run      ``run(case)`` or, of a recorded drive, ``run(case, drive)``: the row of a case, which
             is a value of each axis, ``seed`` and ``seconds``. A function of a module
    drive    of a case: what is simulated and kept, a recipe and one scan in ``every``; None:
             ``run`` makes what it needs
    fits     whether a case is run at all
    lines    axes of which each combination is a line of the table; the rest is pooled
    columns  heading -> cell, of the rows of a line
    across, cell  an axis whose values have a column each, and what stands there
    told     one line on how it was made; fields in braces are those of the options
    page     that holds what is told; None: it is printed
    defaults  of the options, where they are others than usual
    """

    name: str
    axes: Mapping[str, Sequence[Any]]
    run: Callable[..., Row]
    drive: Callable[[Row], Row | None] = lambda case: None
    fits: Callable[[Row], bool] = lambda case: True
    lines: Sequence[str] = ()
    columns: Mapping[str, Column] = field(default_factory=dict)
    across: str = ""
    cell: Column = losses
    told: str = "World {world}, {seeds} seeds from {first_seed}, {seconds:g} s."
    page: Path | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def _parser(self) -> argparse.ArgumentParser:
        command = sys.modules["__main__"]
        parser = argparse.ArgumentParser(prog=self.name, description=command.__doc__)
        for axis, values in self.axes.items():
            kind = type(values[0])
            parser.add_argument(f"--{axis}", nargs="+", type=kind, default=list(values))
        own = Path("out") / self.name
        parser.add_argument("--folder", type=Path, default=own, help="of recordings and rows")
        add_options(parser, f"{self.name}.json", self.page or Path())
        parser.set_defaults(results=own / f"{self.name}.json", **self.defaults)
        return parser

    @ended
    def main(self, arguments: Sequence[str] | None = None) -> None:
        """The command: make what is missing, print the table, write results and page."""
        wanted = self._parser().parse_args(arguments)
        wanted.no_page = wanted.no_page or self.page is None
        first = head(wanted, self.name, arguments, *self.axes)
        rows = self.rows(self.cases(wanted), wanted.folder, wanted.jobs)
        told = self.told.format(world=WORLD, **vars(wanted))
        text = f"{told}\n\n{self.markdown(rows)}"
        write(
            wanted.results,
            first,
            {"runs": {" ".join(str(row[k]) for k in (*self.axes, "seed")): row for row in rows}},
        )
        if not wanted.no_page:
            fill_page(wanted.page, self.name, text)
        print(text)

    def cases(self, wanted: argparse.Namespace) -> list[Row]:
        """Of every value of each axis and every seed, those that fit."""
        values = [getattr(wanted, axis) for axis in self.axes]
        cases = (
            {**dict(zip(self.axes, of, strict=True)), "seed": seed, "seconds": wanted.seconds}
            for *of, seed in product(*values, seeds_of(wanted))
        )
        return [case for case in cases if self.fits(case)]

    def rows(self, cases: Sequence[Row], folder: Path, jobs: int) -> list[Row]:
        """The row of each case, made where it is not there."""
        drives = [recorded(drive) if (drive := self.drive(case)) else None for case in cases]
        missing = {job.name: job for job in drives if job is not None}
        if missing:
            run_jobs(missing.values(), folder / RECORDINGS, processes=jobs, title="drives")
        cells = [self._job(case, job) for case, job in zip(cases, drives, strict=True)]
        files = run_jobs(cells, folder / ROWS, processes=jobs, title=self.name)
        return [json.loads(files[cell.name].read_text()) for cell in cells]

    def _job(self, case: Row, drive: Job | None) -> Job:
        module = _module(self.run)
        call = f"{module}:{self.run.__name__}"
        more = {} if drive is None else {"recording": drive.file_name()}
        return Job(
            name=file_name("_".join(str(value) for value in case.values()))[:150] + _short(case),
            call=cell,
            arguments={"call": call, "case": case, **more},
            suffix=".json",
            code=(*sources(slam, sim, scenes), *_scripts(module)),
        )

    def markdown(self, rows: Sequence[Row]) -> str:
        """The table."""
        wide = dict.fromkeys(row[self.across] for row in rows) if self.across else {}
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for row in rows:
            groups.setdefault(tuple(row[axis] for axis in self.lines), []).append(row)
        lines = []
        for values, own in groups.items():
            cells = [_word(value) for value in values]
            for value in wide:
                of_it = [row for row in own if row[self.across] == value]
                cells.append(self.cell(of_it) if of_it else "–")
            lines.append([*cells, *(tell(own) for tell in self.columns.values())])
        return table((*self.lines, *(_word(value) for value in wide), *self.columns), lines)


def _word(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _short(case: Any) -> str:
    """Apart from names that differ where no file name does."""
    told = json.dumps(case, sort_keys=True, default=str)
    return "-" + hashlib.sha256(told.encode()).hexdigest()[:6]


def _module(call: Callable[..., Row]) -> str:
    """Dotted, of a module that was started as a command, too."""
    spec = sys.modules[call.__module__].__spec__
    return call.__module__ if spec is None else spec.name


@cache
def _scripts(module: str) -> tuple[Path, ...]:
    return scripts_of(str(importlib.import_module(module).__file__), module)


def recorded(drive: Row) -> Job:
    """The job that simulates a drive and keeps one scan in ``every``."""
    every = drive.get("every", 1)
    recipe = Recipe(**{key: value for key, value in drive.items() if key != "every"})
    return Job(
        name=f"{file_name(recipe.scene)}_s{recipe.seed}" + _short(drive),
        call=record,
        arguments={**asdict(recipe), "every": every},
        code=(*sources(sim, scenes), *_scripts(record.__module__)),
    )


def cell(path: Path, *, call: str, case: Row, recording: str = "") -> None:
    """A job: the row of one case, as JSON."""
    module, _, name = call.partition(":")
    run = getattr(importlib.import_module(module), name)
    found = [load(path.parents[1] / RECORDINGS / recording)] if recording else []
    path.write_text(json.dumps({**case, **run(case, *found)}))
