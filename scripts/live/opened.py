# SPDX-License-Identifier: Apache-2.0
"""What is served: a scene with its robot, or a log, and the SLAMs that run on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from scripts.film.footage import KNOBS, of_log, of_simulation, title_of
from scripts.live.hands import Hands
from scripts.live.requests import Anew
from scripts.live.session import Session
from sim.simulation import Simulation


@dataclass(frozen=True, kw_only=True)
class Opener:
    """Makes sessions, each from its start.

    slams     by name, the first of them shown
    path      of a log or a bag, None for a scene
    settings  of the scene, as ``Simulation`` takes them;   seconds  that it lives
    """

    slams: Sequence[str]
    path: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0

    def anew(self, request: Anew) -> Opener:
        """The same with what a page has asked for."""
        slams = [request.slam or self.slams[0], *self.slams[1:]]
        asked = {k: getattr(request, k) for k in KNOBS if getattr(request, k) is not None}
        settings = {**self.settings, **asked} if self.path is None else self.settings
        return replace(self, slams=list(dict.fromkeys(slams)), settings=settings)

    def open(self) -> Session:
        """A session at its start.

        Raises ``NeedsLabelsError`` for an oracle on a log without labels, ``LogFormatError`` for a
        file that cannot be read.
        """
        hands = None
        if self.path is None:
            simulation = Simulation(**self.settings, labels=True)
            hands = Hands(simulation)
            moments = partial(hands.moments, self.seconds)
            footage = of_simulation(
                simulation, moments, seconds=self.seconds, title=title_of(self.settings), view=None
            )
        else:
            footage = of_log(self.path)
        return Session(footage, footage.show(self.slams).moments, hands)
