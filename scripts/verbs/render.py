# SPDX-License-Identifier: Apache-2.0
"""``mobilia render``: a film, a strip or a page to turn of a run, an episode or a log."""

import math
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts import options
from scripts.console import note, say
from scripts.film import FPS
from scripts.names import check, run_name
from scripts.spec import REQUIRED, SLAMS, argument, option, spec
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from scripts.film.encode import Pace
    from scripts.film.footage import Footage
    from scripts.film.show import Show

STRIP_PICTURES = 6


@spec
class Render:
    """Film a run: 3D view, scan by what each beam hit, map, errors, events.

    Needs no screen. With [bold]--strip[/bold] or [bold]--replay[/bold] and no [bold]--out[/bold],
    only these are made.

    [bold]mobilia render out/demo --strip strip.png --out film.mp4[/bold]
    """

    folder: Path = argument(
        "Folder of a run or of an episode, DIR/runs/NAME.npz of a comparison (each made "
        "again from its recipe), or a log.",
        REQUIRED,
        metavar="RUN",
    )
    out: Path | None = option(
        "The film; default out/<name of RUN>.mp4.", writes="file", suffix=".mp4"
    )
    slam: str | None = option("SLAM to film; default the run's own, else shunting.", complete=SLAMS)
    strip_to: Path | None = option(
        "Also a PNG of some moments side by side.", None, "--strip", writes="file", suffix=".png"
    )
    at: str = option("Moments of the strip, s: 3,12.5,40. Default: six, evenly spaced.", "")
    replay: Path | None = option(
        "Also a page to turn and to scrub, for any browser (.html).", writes="file", suffix=".html"
    )
    view: str = option(
        "View of the 3D camera: follow, top or persp.", "follow",
        choices=("follow", "top", "persp"),
    )  # fmt: skip
    no_3d: bool = option("Leave the 3D view out.", False)
    fps: float = option("Pictures per second.", FPS)
    size: str = option("Size of the film, px.", "1280x720")
    from_s: float = option("First moment shown, s.", 0.0, "--from")
    to_s: float | None = option("Last moment shown, s; default the end.", None, "--to")
    speed: float | None = option(
        "1 is real time. Default 1, more where the film would exceed a minute."
    )
    trust: bool = options.TRUST()

    def __call__(self) -> None:
        out = self.out
        if out is None and self.strip_to is None and self.replay is None:
            out = Path("out") / f"{run_name(self.folder)}.mp4"
        if self.at and self.strip_to is None:
            raise InvalidValueError("--at names the moments of --strip, which is missing")
        moments = _moments(self.at)
        check([self.slam])
        from scripts.film.encode import require_ffmpeg, size_of
        from scripts.film.footage import open_run
        from scripts.film.render import evenly

        if out is not None:
            require_ffmpeg()
        pixels = size_of(self.size)
        seen = self.view if out is not None and not self.no_3d else None
        with open_run(self.folder, view=seen, trust=self.trust) as footage:
            if moments and moments[-1] > footage.duration_s:
                raise InvalidValueError(
                    f"--at must lie within the run's {footage.duration_s:.1f} s, "
                    f"got {moments[-1]:g}"
                )
            pace = self._pace(footage)
            own = options.admitted(footage.slam, "SLAM", self.trust) if not self.slam else ""
            show = footage.show([self.slam or own or "shunting"], pace=pace, size=pixels)
            if footage.no_camera:
                note(f"the film has no 3D panel: {footage.no_camera}")
            if self.strip_to is not None and not moments:
                end = min(pace.to_s, footage.duration_s)
                moments = evenly(STRIP_PICTURES, pace.from_s, end)
            self._film(footage, show, moments, out)

    def _pace(self, footage: "Footage") -> "Pace":
        from scripts.film.encode import Pace

        start, long_s = self.from_s, footage.duration_s
        end = long_s if self.to_s is None else self.to_s
        if not (math.isfinite(start) and math.isfinite(end) and 0.0 <= start < max(end, 1e-3)):
            raise InvalidValueError(
                f"--from must be >= 0 s and before --to, got {start:g} and {end:g} s"
            )
        if start > long_s:
            raise InvalidValueError(
                f"--from must lie within the run's {long_s:.1f} s, got {start:g}"
            )
        usual = Pace.within_a_minute(min(end, long_s) - start, self.fps).speed
        return Pace(
            fps=self.fps, speed=usual if self.speed is None else self.speed, from_s=start,
            to_s=math.inf if self.to_s is None else self.to_s,
        )  # fmt: skip

    def _film(
        self, footage: "Footage", show: "Show", moments: list[float], out: Path | None
    ) -> None:
        """Whatever is asked for, of the same pictures."""
        from scripts.film.encode import film
        from scripts.film.render import Snapshots, shoot, strip, watched
        from scripts.live.replay import Recorder

        started = time.perf_counter()
        with ExitStack() as stack:
            reel = stack.enter_context(film(out, show.pace.fps)) if out is not None else None
            recorder = None
            if self.replay is not None:
                recorder = stack.enter_context(Recorder.of(self.replay, show))
            snapshots = Snapshots(show, moments, show.vignette)
            for frame in watched(shoot(footage.stream, show, reel), footage.stream, show.title):
                snapshots.note(frame)
                if recorder is not None:
                    recorder.note(show.shown)
            if self.strip_to is not None:
                strip(
                    snapshots.finish(),
                    moments,
                    self.strip_to,
                    columns=3,
                    legend=show.moments.legend(),
                )
        wall_s = time.perf_counter() - started
        if reel is not None and out is not None:
            long_s = reel.frames / show.pace.fps
            made = f"made in {wall_s:.1f} s ({long_s / wall_s:.1f} × real time)"
            what = f"{reel.frames} pictures, {long_s:.1f} s, {made}"
            say(f"Wrote [bold]{escape(str(out))}[/bold]: {what}.")
        for path in (self.strip_to, self.replay):
            if path is not None:
                say(f"Wrote [bold]{escape(str(path))}[/bold].")


def _moments(words: str) -> list[float]:
    try:
        moments = [float(word) for word in words.split(",") if word.strip()]
    except ValueError as error:
        raise InvalidValueError(f"--at must be seconds such as 3,12.5,40, got '{words}'") from error
    if any(not (math.isfinite(m) and m >= 0.0) for m in moments) or moments != sorted(moments):
        raise InvalidValueError(f"--at must be seconds >= 0 in rising order, got '{words}'")
    if len(moments) > 100:
        raise InvalidValueError(f"--at takes at most 100 moments, got {len(moments)}")
    return moments
