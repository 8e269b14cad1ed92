# SPDX-License-Identifier: Apache-2.0
"""``mobilia verify``: is a result what it was, and does its recipe still make it?"""

import secrets
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from scripts import interrupt, options
from scripts.console import console, fail, plain, progress, say, working
from scripts.options import admitted
from scripts.spec import REQUIRED, SLAMS, argument, option, spec
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from sim.recording.verify import Finding

_COLORS = {
    "whole": "green", "same bytes": "green", "damaged": "red", "incomplete": "red",
}  # fmt: skip


@spec
class Verify:
    """Check every file by its hash; with --regenerate also make episodes again.

    Exit status: 0 all well. 1 damaged: a file is not what it was, or an episode comes out otherwise
    on the very CPU and versions that made it (on others it may: that is said, and is no failure).
    2 there is nothing at that path. 3 incomplete: a file or an episode is missing. 4 foreign:
    something is there that no SHA256SUMS lists. 5 same messages, other bytes: a bag was packed
    anew. 6 the recordings of a submission cannot be checked here: they were made on another kind of
    processor or with other versions. The first that holds counts.

    Of a submission to the benchmark --regenerate makes recordings again: its results are the
    submitter's word. --rerun also runs its SLAM, which must be installed here, on recordings drawn
    by --seed.
    """

    folder: Path = argument(
        "A dataset, an episode, a folder of run, demo, compare, benchmark, drive, "
        "blame or shrink, a map, or a submission to the benchmark.",
        REQUIRED,
    )
    regenerate: int = option("Simulate this many episodes again and compare.", 0)
    rerun: int = option("Of a submission: also run its SLAM on this many, compare its poses.", 0)
    slam: str | None = option(
        "The SLAM to --rerun; default the one that the file names.", complete=SLAMS
    )
    seed: int | None = option(
        "Which ones: seed of that choice; default 0, of a submission by chance."
    )
    trust: bool = options.TRUST()

    def __call__(self) -> None:
        if min(self.regenerate, self.rerun, self.seed or 0) < 0:
            raise InvalidValueError("--regenerate, --rerun and --seed must be >= 0")
        from scripts.results import check

        with working("checking every file"):
            findings = check(self.folder)
        checked = len(findings)
        submitted = self.folder.suffix == ".json" and self.folder.is_file()
        if not submitted and (self.rerun or self.slam):
            raise InvalidValueError("--rerun and --slam are for a submission")
        if self.slam is not None and not self.rerun:
            raise InvalidValueError("--slam is the SLAM to --rerun: say how many runs")
        if submitted and findings[0].ok:
            findings += self._of_submission()
        elif self.regenerate:
            drawn = _drawn(_sound(self.folder, findings), self.regenerate, self.seed or 0)
            findings += _made_again(drawn, self.trust)
        for finding in findings:
            _tell(finding)
        _exit_if_bad(findings)
        again = len(findings) - checked
        if submitted:
            console.print(_judgement(again, self.rerun))
        else:
            console.print(f"{checked} checked, {again} of them made again: all well")

    def _of_submission(self) -> "list[Finding]":
        """A finding for each of its runs that was made again."""
        from scripts.benchmark import submission
        from scripts.benchmark.submission import made_again
        from slam.names import NameFromFile

        count = self.rerun or self.regenerate
        seed = _by_chance(self.regenerate or self.rerun) if self.seed is None else self.seed
        given = submission.read(self.folder)
        runs = self.slam
        if self.rerun and runs is None:
            runs = admitted(NameFromFile(given.slam, self.folder), "SLAM", self.trust)
        return list(made_again(self.folder, count, seed, runs))


def _by_chance(count: int) -> int:
    """A seed that nobody who submits can know."""
    seed = secrets.randbelow(2**32)
    if count:
        console.print(f"drawn with --seed {seed}")
    return seed


def _judgement(again: int, rerun: int) -> str:
    if not again:
        return "the file is whole; the results are the submitter's word"
    if rerun:
        return f"the file is whole, and {again} of its runs came out again: scans and poses"
    made = f"the recordings of {again} of its runs are right"
    return f"the file is whole, {made}; the results are the submitter's word"


def _made_again(episodes: list[Path], trust: bool) -> "list[Finding]":
    """A finding for each episode, simulated again."""
    from sim.recording.recipe import RECIPE, read_recipe
    from sim.recording.verify import regenerate

    for scene in dict.fromkeys(read_recipe(path / RECIPE).recipe.scene for path in episodes):
        admitted(scene, "scene", trust)
    findings = []
    with progress() as bar:
        task = bar.add_task("making again", total=len(episodes), unit="", visible=bool(episodes))
        for episode in episodes:
            interrupt.check()
            findings.append(regenerate(episode, trust=trust))
            bar.advance(task)
    return findings


def _drawn(episodes: list[Path], count: int, seed: int) -> list[Path]:
    """So many of them at random, all where there are fewer, in their order."""
    import numpy as np

    count = min(count, len(episodes))
    drawn = np.random.default_rng(seed).choice(len(episodes), count, replace=False)
    return [episodes[k] for k in sorted(drawn.tolist())]


def _exit_if_bad(findings: "list[Finding]") -> None:
    """End with the status of the worst of them, where one is not whole."""
    from sim.recording.verify import STATUS

    bad = [finding for finding in findings if not finding.ok]
    if bad:
        worst = min(bad, key=lambda finding: list(STATUS).index(finding.verdict))
        fail(f"{len(bad)} of {len(findings)} findings are not 'whole'; {_words(worst)}")
        raise typer.Exit(worst.status)


def _sound(folder: Path, findings: "list[Finding]") -> list[Path]:
    """The episodes that can be made again: planned, and with nothing of theirs missing."""
    from sim.recording.dataset import episodes_in

    sound = {f.episode for f in findings if f.verdict not in ("damaged", "incomplete")}
    return [path for path in episodes_in(folder.resolve()) if path.name in sound]


def _words(finding: "Finding") -> str:
    why = finding.why if len(finding.why) <= 300 else f"{finding.why[:300]} ..."
    return f"{finding.verdict}: {why}"


def _tell(finding: "Finding") -> None:
    color = _COLORS.get(finding.verdict, "yellow")
    why = f": {plain(finding.why)}" if finding.why else ""
    say(f"[{color}]{finding.verdict}[/{color}] {plain(finding.episode)}{why}")
