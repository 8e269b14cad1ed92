# SPDX-License-Identifier: Apache-2.0
"""SLAMs on a recorded log or on a simulated tour, scored, mapped and filmed."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scripts.console import note, working
from scripts.days.one import Maps, kept, session_of
from scripts.film.encode import Pace
from scripts.film.footage import of_log, of_scene
from scripts.pace import Work
from scripts.single_run.session import Outputs, run_session
from scripts.single_run.understood import UntrustedRunError, distrust, mount_of, tell

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Log:
    """A log to be run on.

    strict       refuse repairs, a mounting that its scans contradict, and a run that nobody trusts
    text_format  describes a text log
    laser, flip  how the scanner is mounted, where the log does not say it: ``mount_of``
    """

    path: Path
    strict: bool = False
    text_format: Path | None = None
    laser: str | None = None
    flip: bool = False


def on_log(
    names: list[str],
    log: Log,
    out: Path,
    *,
    overwrite: bool,
    film: bool,
    maps: Maps | None = None,
) -> dict[str, Any]:
    """Run SLAMs on a recorded log; the first of them in a map of days before, if ``maps`` says."""
    path = log.path
    with working(f"reading {path.name}"):
        footage = of_log(
            path, strict=log.strict, text_format=log.text_format,
            mount=mount_of(log.laser), flip=log.flip,
        )  # fmt: skip
    found = tell(footage, strict=log.strict)
    show = footage.show(names)
    session = None
    if maps is not None and maps.given:
        session = session_of(show.primary, maps, footage.stream)
        show.replay.tracks[show.primary].system = session
    settings = {
        "slams": list(show.replay.tracks),
        "log": path.name,
        "log_sha256": hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None,
        "log_facts": dict(footage.stream.metadata.extra),
    }
    results = run_session(
        footage.stream,
        show,
        Outputs(
            folder=out,
            command="run",
            settings=settings,
            overwrite=overwrite,
            film=film,
            pace=Pace.of_log(footage.duration_s, footage.stream.length or 1),
        ),
    )
    if session is not None and maps is not None:
        kept(session, maps)
    words = distrust(show.track(), footage, found)
    if words and log.strict:
        raise UntrustedRunError(words)
    if words:
        _log.warning("%s", words)
    return results


def on_scene_work(names: list[str], seconds: float, film: bool) -> Work:
    """For an estimate: about so much for each SLAM, and more with a film."""
    return Work("run on a scene" + ", filmed" * film, seconds * len(names))


def on_log_work(names: list[str], path: Path, film: bool) -> Work:
    """The same of a log, which is not read for it: by its MB."""
    files = path.rglob("*") if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return Work(f"run on {path.suffix}" + ", filmed" * film, size / 1e6 * len(names))


def on_scene(names: list[str], settings: Mapping[str, Any], outputs: Outputs) -> dict[str, Any]:
    """Run SLAMs on a tour of a scene.

    settings  scene, seconds, dynamism, seed; further keys go to ``Simulation``
    """
    with of_scene(settings, view="follow" if outputs.film else None) as footage:
        show = footage.show(names)
        if outputs.film and footage.no_camera:
            note(f"the film has no 3D panel: {footage.no_camera}")
        recipe = {"slams": list(show.replay.tracks), **settings, **footage.made_with}
        return run_session(footage.stream, show, replace(outputs, settings=recipe))
