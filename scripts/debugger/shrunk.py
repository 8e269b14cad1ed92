# SPDX-License-Identifier: Apache-2.0
"""What is left of a lost run: its recipe, replayed once more for the film, and the folder of it."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
from rich.table import Table

from scripts import figures, interrupt
from scripts.console import progress
from scripts.debugger.recording import Case
from scripts.debugger.shrinking import MOST_S, Part, Shrinking, lost_row
from scripts.film.encode import require_ffmpeg
from scripts.film.footage import of_scene
from scripts.metrics.judged import in_first_frame
from scripts.output import RECIPE, write_recipe
from scripts.single_run.session import Outputs, play
from scripts.whole_folder import whole_folder
from sim.twins.cut import Cut
from slam.errors import MobiliaError, SlamFailedError
from slam.files import write_text
from slam.frames import Frame


@dataclass(frozen=True, kw_only=True)
class Shrunk:
    """What is left of a run.

    world   settings of its recipe but for the SLAM: scene, seconds, ``cut`` and so on
    sizes   (before, left) of seconds, movers, events, scans, beams
    tries   parts that were run;   stopped  after ``MOST_S``
    """

    slam: str
    world: dict[str, Any]
    sizes: dict[str, tuple[float, float]]
    tries: int
    stopped: bool

    def said(self, folder: Path, wall_s: float) -> list[str]:
        """The result in sentences."""
        keep, (before, left) = self.world["cut"]["keep"], self.sizes["seconds"]
        who = f"only {', '.join(keep)} can move" if keep else "nothing can move"
        who = "all movers stay" if keep is None else who
        size, stop = (folder / RECIPE).stat().st_size, f"; it ended after {MOST_S:g} s"
        return [
            f"`{self.slam}` is lost in {left:g} s of {before:g} s; {who}.",
            f"{RECIPE} has {size} bytes; replayed, it gives the same scans and the same loss. "
            f"The search tried {self.tries} parts in {wall_s:.0f} s{stop * self.stopped}.",
        ]

    def table(self) -> Table:
        """From what to what."""
        shown = Table()
        for heading, justify in (("", "left"), ("the run", "right"), ("left", "right")):
            shown.add_column(heading, justify=justify)  # type: ignore[arg-type]
        for word, (before, left) in self.sizes.items():
            shown.add_row(word, f"{before:g}", f"{left:g}")
        return shown


def shrunk(case: Case) -> Shrunk:
    """The smallest part of a run that is found.

    Raises as ``Shrinking.smallest``, and ``MobiliaError`` and ``SlamFailedError`` where its recipe,
    made again, does not give the frames of the last try or the SLAM is not lost in them again.
    """
    with progress() as bar:
        task = bar.add_task("driving", total=None, unit="")

        def note(words: str) -> None:
            interrupt.check()
            bar.update(task, description="shrinking", unit=words)

        search = Shrinking(case, note)
        before = _sizes(search, search.whole)
        part = search.smallest()
    from_s, to_s = (round(scan * search.period_s, 3) for scan in (part.first, part.last))
    cut = Cut(from_s=from_s, keep=part.keep, every=part.every, beams=part.beams)
    left = _sizes(search, part)
    world = {**search.case.settings, "seconds": to_s, "cut": asdict(cut)}
    with of_scene(world, view=None) as footage:
        again = list(footage.stream)
    if _told(again) != _told(search.frames(part)):
        raise MobiliaError("the recipe, replayed, does not give the scans of the last try")
    if lost_row(case.slam, again) is None:
        raise SlamFailedError(f"SLAM '{case.slam}' does not repeat itself on the same frames")
    return Shrunk(
        slam=case.slam, world=world, tries=len(search.tried), stopped=search.spent_s > MOST_S,
        sizes={word: (size, left[word]) for word, size in before.items()},
    )  # fmt: skip


def _told(frames: Iterable[Frame]) -> list[Frame]:
    return [replace(frame, labels=None) for frame in frames]


def _sizes(search: Shrinking, part: Part) -> dict[str, float]:
    scan, settings = search.tape.strip.frames[0].scan, search.case.settings
    assert scan is not None
    movers = [kind for kind in search.tape.kinds if kind != "robot"]
    return {
        "seconds": round(part.scans * search.period_s, 1),
        "movers": len(movers if part.keep is None else part.keep),
        "events": len(settings.get("events") or ()) + ("kidnap_every_s" in settings),
        "scans": -(-part.scans // part.every),
        "beams": -(-scan.spec.n_beams // part.beams),
    }


def carry_out(case: Case, folder: Path, *, overwrite: bool, filmed: bool) -> Shrunk:
    """Find it and write the folder."""
    if filmed:
        require_ffmpeg()
    asked = {"slams": [case.slam], **case.settings}
    with whole_folder(folder, overwrite=overwrite, command="shrink", settings=asked) as part:
        found = shrunk(case)
        _replay(part, found, filmed)
        text = json.dumps({"schema": 1, **asdict(found)}, indent=1, allow_nan=False)
        write_text(part / "shrink.json", text + "\n")
        write_recipe(part, "shrink", {"slams": [case.slam], **found.world})
    return found


def _replay(folder: Path, found: Shrunk, filmed: bool) -> None:
    """Film and errors of the recipe, made again from the start."""
    with of_scene(found.world, view="follow" if filmed else None) as footage:
        show = footage.show([found.slam])
        outputs = Outputs(folder=folder, command="shrink", film=filmed)
        picture = play(folder, footage.stream, show, outputs).last
    if picture is not None:
        imageio.imwrite(folder / "poster.png", picture)
    truth, tracks = show.replay.truth(), show.replay.tracks
    assert truth is not None
    online = {name: track.online() for name, track in tracks.items()}
    figures.errors(folder / "errors.png", online, in_first_frame(truth))
