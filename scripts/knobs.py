# SPDX-License-Identifier: Apache-2.0
"""``--motion``, ``--change`` and ``--crowd``, the same on every verb that simulates.

Which of the axes of ``sim.core.dynamism`` the levels of ``compare`` and ``drive`` are of, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import typer

from slam.errors import InvalidValueError

AXES = ("dynamism", "motion", "change")

Motion = Annotated[
    float | None,
    typer.Option(help="What moves now, 0 to 1; default as --dynamism says."),
]
Change = Annotated[
    float | None,
    typer.Option(
        help="Of what can move, the share that stands elsewhere when it is seen again, 0 to 1; "
        "default as --dynamism says."
    ),
]
CrowdOption = Annotated[
    str | None,
    typer.Option(
        "--crowd",
        help="Who is there besides: none, or like escorts:6,boards:2; default the scene's own at "
        "this motion (mobilia config crowds).",
    ),
]
MotionLevels = Annotated[
    list[str] | None, typer.Option("--motion", help="Levels of motion alone, or one to hold.")
]
ChangeLevels = Annotated[
    list[str] | None, typer.Option("--change", help="Levels of change alone, or one to hold.")
]


@dataclass(frozen=True, kw_only=True)
class Held:
    """What holds in every run: levels of axes in [0, 1] and the crowd; None: as dynamism says."""

    motion: float | None = None
    change: float | None = None
    crowd: str | None = None

    def __post_init__(self) -> None:
        for name in ("motion", "change"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value <= 1.0:
                raise InvalidValueError(f"--{name} must lie in [0, 1], got {value}")
        if self.crowd is not None:
            from scenes.crowd import crowd_of

            crowd_of(self.crowd)

    def given(self) -> dict[str, Any]:
        """Those that are not None."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def options_with(crowd: str | None) -> dict[str, Any]:
    """A crowd among the options of a scene."""
    return {} if crowd is None else {"crowd": crowd}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What the levels of a comparison or a drive are of, and what is held.

    name  one of ``AXES``; with "motion" the other, change, is at 0 unless held, and so round
    """

    name: str = "dynamism"
    held: Held = Held()

    def __post_init__(self) -> None:
        if self.name not in AXES:
            raise InvalidValueError(f"axis must be one of {', '.join(AXES)}, got {self.name!r:.80}")
        if getattr(self.held, self.name, None) is not None:
            raise InvalidValueError(f"--{self.name} cannot be held: the levels are of it")

    def at(self, level: float) -> dict[str, Any]:
        """``dynamism``, ``motion`` and ``change`` at a level, as ``Simulation`` takes them."""
        held = {"motion": self.held.motion, "change": self.held.change}
        if self.name == "dynamism":
            return {"dynamism": level, **held}
        return {"dynamism": 0.0, **held, self.name: level}


def axis_of(plan: Mapping[str, Any]) -> Axis:
    """That of the settings of a comparison or drive; those of before had dynamism alone."""
    names = ("motion", "change", "crowd")
    given = {name: plan[name] for name in names if plan.get(name) is not None}
    return Axis(name=plan.get("axis", "dynamism"), held=Held(**given))


def chosen(
    dynamism: Sequence[float], motion: Sequence[float], change: Sequence[float]
) -> tuple[str, tuple[float, ...], dict[str, float]]:
    """The axis, its levels, and what is held, from what was given of each; () for nothing.

    The axis is the one with several levels, else dynamism, motion or change, the first given.
    """
    given = {"dynamism": dynamism, "motion": motion, "change": change}
    several = [name for name, levels in given.items() if len(levels) > 1]
    if len(several) > 1:
        raise InvalidValueError(f"several levels of one axis only, got --{' and --'.join(several)}")
    name = (several or [axis for axis in AXES if given[axis]] or ["dynamism"])[0]
    if name != "dynamism" and dynamism:
        raise InvalidValueError(
            f"--dynamism sets both axes: with levels of --{name} give the other axis instead"
        )
    held = {axis: given[axis][0] for axis in ("motion", "change") if axis != name and given[axis]}
    return name, tuple(given[name]), held
