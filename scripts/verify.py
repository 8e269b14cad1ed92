# SPDX-License-Identifier: Apache-2.0
"""``mobilia verify``: is a dataset what it was, and does its recipe still make it?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from scripts import interrupt
from scripts.console import console, fail, progress
from scripts.trust import Trust, admitted
from sim.recording.dataset import episodes_in
from sim.recording.recipe import RECIPE, read_recipe
from sim.recording.verify import Finding, check_hashes, regenerate
from slam.errors import InvalidValueError

_COLORS = {"whole": "green", "same bytes": "green", "same messages": "green", "damaged": "red"}


def verify(
    folder: Annotated[Path, typer.Argument(help="A dataset, or one episode.")],
    regenerate_: Annotated[
        int, typer.Option("--regenerate", help="Simulate this many episodes anew and compare.")
    ] = 0,
    seed: Annotated[int, typer.Option(help="Which ones: seed of that choice.")] = 0,
    trust: Trust = False,
) -> None:
    """Hash every file again; with --regenerate also make episodes anew from their recipes.

    Exit status 1 when a file is damaged, or when an episode comes out otherwise on the very CPU and
    versions that made it. On others it may: that is said, and is no failure.
    """
    if regenerate_ < 0 or seed < 0:
        raise InvalidValueError("--regenerate and --seed must be >= 0")
    episodes = episodes_in(folder)
    findings = [check_hashes(episode) for episode in episodes]
    sound = [e for e, f in zip(episodes, findings, strict=True) if f.verdict != "damaged"]
    count = min(regenerate_, len(sound))
    drawn = np.random.default_rng(seed).choice(len(sound), count, replace=False)
    chosen = [sound[k] for k in sorted(drawn.tolist())]
    for scene in dict.fromkeys(read_recipe(episode / RECIPE).recipe.scene for episode in chosen):
        admitted(scene, "scene", trust)
    with progress() as bar:
        task = bar.add_task("making again", total=count, unit="", visible=count > 0)
        for episode in chosen:
            interrupt.check()
            findings.append(regenerate(episode, trust=trust))
            bar.advance(task)
    for finding in findings:
        _tell(finding)
    bad = [finding for finding in findings if not finding.ok]
    if bad:
        fail(f"{len(bad)} of {len(episodes)} episodes are not what they were: {bad[0].why}")
        raise typer.Exit(1)
    console.print(f"{len(episodes)} episodes, {count} of them made again: all well")


def _tell(finding: Finding) -> None:
    color = _COLORS.get(finding.verdict, "yellow")
    why = f": {escape(finding.why)}" if finding.why else ""
    console.print(
        f"[{color}]{finding.verdict}[/{color}] {escape(finding.episode)}{why}", soft_wrap=True
    )
