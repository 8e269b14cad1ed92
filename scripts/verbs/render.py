# SPDX-License-Identifier: Apache-2.0
"""``mobilia render``: a film, a strip or a page to turn of a run, an episode or a log."""

import math
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from scripts.console import note, say
from scripts.film import FPS
from scripts.names import check, run_name
from scripts.options import Trust, admitted
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from scripts.film.encode import Pace
    from scripts.film.footage import Footage
    from scripts.film.show import Show

STRIP_PICTURES = 6
VIEWS = ("follow", "top", "persp")


def render(
    run: Annotated[
        Path,
        typer.Argument(
            help="Folder of a run or of an episode, DIR/runs/NAME.npz of a comparison (each made "
            "again from its recipe), or a log.",
            metavar="RUN",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="The film; default out/<name of RUN>.mp4.")
    ] = None,
    slam: Annotated[
        str | None, typer.Option(help="SLAM to film; default the run's own, else shunting.")
    ] = None,
    strip_to: Annotated[
        Path | None, typer.Option("--strip", help="Also a PNG of some moments side by side.")
    ] = None,
    at: Annotated[
        str, typer.Option(help="Moments of the strip, s: 3,12.5,40. Default: six, evenly spaced.")
    ] = "",
    replay: Annotated[
        Path | None, typer.Option(help="Also a page to turn and to scrub, for any browser (.html).")
    ] = None,
    view: Annotated[
        str, typer.Option(help="View of the 3D camera: follow, top or persp.")
    ] = "follow",
    no_3d: Annotated[bool, typer.Option("--no-3d", help="Leave the 3D view out.")] = False,
    fps: Annotated[float, typer.Option(help="Pictures per second.")] = FPS,
    size: Annotated[str, typer.Option(help="Size of the film, px.")] = "1280x720",
    from_s: Annotated[float, typer.Option("--from", help="First moment shown, s.")] = 0.0,
    to_s: Annotated[
        float | None, typer.Option("--to", help="Last moment shown, s; default the end.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="1 is real time. Default 1, more where the film would exceed a minute."),
    ] = None,
    trust: Trust = False,
) -> None:
    """Film a run: 3D view, scan by what each beam hit, map, errors, events.

    Needs no screen. With [bold]--strip[/bold] or [bold]--replay[/bold] and no [bold]--out[/bold],
    only these are made.

    [bold]mobilia render out/demo --strip strip.png --out film.mp4[/bold]
    """
    if view not in VIEWS:
        raise InvalidValueError(f"--view must be one of {', '.join(VIEWS)}, got '{view}'")
    if out is None and strip_to is None and replay is None:
        out = Path("out") / f"{run_name(run)}.mp4"
    if at and strip_to is None:
        raise InvalidValueError("--at names the moments of --strip, which is missing")
    moments = _moments(at)
    check([slam] if slam else [])
    _check_outputs(out, strip_to, replay)
    from scripts.film.encode import size_of
    from scripts.film.footage import open_run
    from scripts.film.render import evenly

    pixels = size_of(size)
    seen = view if out is not None and not no_3d else None
    with open_run(run, view=seen, trust=trust) as footage:
        if moments and moments[-1] > footage.duration_s:
            raise InvalidValueError(
                f"--at must lie within the run's {footage.duration_s:.1f} s, got {moments[-1]:g}"
            )
        pace = _pace(footage, fps, from_s, to_s, speed)
        filmed = slam or admitted(footage.slam, "SLAM", trust) or "shunting"
        show = footage.show([filmed], pace=pace, size=pixels)
        if footage.no_camera:
            note(f"the film has no 3D panel: {footage.no_camera}")
        if strip_to is not None and not moments:
            moments = evenly(STRIP_PICTURES, pace.from_s, min(pace.to_s, footage.duration_s))
        _render(footage, show, out, strip_to, moments, replay)


def _render(
    footage: "Footage",
    show: "Show",
    out: Path | None,
    strip_to: Path | None,
    moments: list[float],
    replay: Path | None,
) -> None:
    from scripts.film.encode import film
    from scripts.film.render import Snapshots, shoot, strip, watched
    from scripts.live.replay import Recorder

    started = time.perf_counter()
    with ExitStack() as stack:
        reel = stack.enter_context(film(out, show.pace.fps)) if out is not None else None
        recorder = stack.enter_context(Recorder.of(replay, show)) if replay is not None else None
        snapshots = Snapshots(show, moments, show.vignette)
        for frame in watched(shoot(footage.stream, show, reel), footage.stream, show.title):
            snapshots.note(frame)
            if recorder is not None:
                recorder.note(show.shown)
        if strip_to is not None:
            strip(snapshots.finish(), moments, strip_to, columns=3, legend=show.legend())
    wall_s = time.perf_counter() - started
    if reel is not None and out is not None:
        long_s = reel.frames / show.pace.fps
        say(
            f"Wrote [bold]{escape(str(out))}[/bold]: {reel.frames} pictures, {long_s:.1f} s, made "
            f"in {wall_s:.1f} s ({long_s / wall_s:.1f} × real time)."
        )
    for path in (strip_to, replay):
        if path is not None:
            say(f"Wrote [bold]{escape(str(path))}[/bold].")


def _pace(
    footage: "Footage", fps: float, from_s: float, to_s: float | None, speed: float | None
) -> "Pace":
    from scripts.film.encode import Pace

    end = footage.duration_s if to_s is None else to_s
    if not (math.isfinite(from_s) and math.isfinite(end) and 0.0 <= from_s < max(end, 1e-3)):
        raise InvalidValueError(
            f"--from must be >= 0 s and before --to, got {from_s:g} and {end:g} s"
        )
    if from_s > footage.duration_s:
        raise InvalidValueError(
            f"--from must lie within the run's {footage.duration_s:.1f} s, got {from_s:g}"
        )
    shown = min(end, footage.duration_s) - from_s
    usual = Pace.within_a_minute(shown, fps).speed
    return Pace(
        fps=fps,
        speed=usual if speed is None else speed,
        from_s=from_s,
        to_s=math.inf if to_s is None else to_s,
    )


def _check_outputs(out: Path | None, strip_to: Path | None, replay: Path | None) -> None:
    """Writers choose formats by the suffix, as do those who open the file; what they need is there.

    Raises ``InvalidValueError`` for another suffix, ``MissingDependencyError`` without a writer.
    """
    for option, path, suffix in (
        ("--out", out, ".mp4"),
        ("--strip", strip_to, ".png"),
        ("--replay", replay, ".html"),
    ):
        if path is not None and path.suffix.lower() != suffix:
            raise InvalidValueError(f"{option} must be a file that ends in {suffix}, got '{path}'")
    if out is not None:
        from scripts.film.encode import require_ffmpeg

        require_ffmpeg()


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
