# SPDX-License-Identifier: Apache-2.0
"""What is left of a lost run: its recipe, replayed once more for the film, and the folder of it."""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
from rich.table import Table

from scripts import figures, interrupt
from scripts.console import progress
from scripts.debugger.recording import Case
from scripts.debugger.shrinking import MOST_S, Part, Shrinking, digest, lost_row
from scripts.film.encode import film, require_ffmpeg
from scripts.film.footage import of_scene
from scripts.film.render import shoot, watched
from scripts.live.replay import Recorder
from scripts.metrics.judged import in_first_frame, world_truth
from scripts.output import RECIPE, write_recipe
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
    sha256  ``digest`` of what the SLAM gets
    """

    slam: str
    world: dict[str, Any]
    sizes: dict[str, tuple[float, float]]
    tries: int
    stopped: bool
    sha256: str

    def check(self, frames: Sequence[Frame]) -> None:
        """That these are the frames of the last try, and that its SLAM is lost in them again.

        Raises ``MobiliaError``, ``SlamFailedError``.
        """
        if digest(frames) != self.sha256:
            raise MobiliaError("the recipe, replayed, does not give the scans of the last try")
        if lost_row(self.slam, frames) is None:
            raise SlamFailedError(f"SLAM '{self.slam}' does not repeat itself on the same frames")

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
    """The smallest part of a run that is found; raises as ``Shrinking.smallest``."""
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
    return Shrunk(
        slam=case.slam, world={**search.case.settings, "seconds": to_s, "cut": asdict(cut)},
        sizes={word: (size, left[word]) for word, size in before.items()},
        tries=len(search.tried), stopped=search.spent_s > MOST_S,
        sha256=digest(search.frames(part)),
    )  # fmt: skip


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
    frames: list[Frame] = []
    with ExitStack() as stack:
        footage = stack.enter_context(of_scene(found.world, view="follow" if filmed else None))
        show, reel, recorder = footage.show([found.slam]), None, None
        if filmed:
            reel = stack.enter_context(film(folder / "film.mp4", show.pace.fps))
            recorder = stack.enter_context(Recorder.of(folder / "replay.html", show))
        for frame in watched(shoot(footage.stream, show, reel), footage.stream, footage.title):
            frames.append(frame)
            if recorder is not None and show.shown is not None:
                recorder.note(show.shown)
        if reel is not None and reel.last is not None:
            imageio.imwrite(folder / "poster.png", reel.last)
    found.check(frames)
    tracks = {name: track.online() for name, track in show.replay.tracks.items()}
    figures.errors(folder / "errors.png", tracks, in_first_frame(world_truth(frames)))
