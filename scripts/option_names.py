# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a field is said by the name of the option that it came from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from typer.core import TyperCommand

from slam.errors import InvalidValueError

# Fields that are called otherwise than their option; of several the first that the verb has.
OPTIONS_OF: dict[str, tuple[str, ...]] = {
    "Plan.slams": ("--slam",),
    "Plan.scenes": ("--scene",),
    "Plan.levels": ("--dynamism",),
    "Plan.dynamisms": ("--dynamism-sweep",),
    "Limits.scan_s": ("--scan-limit",),
    "LoopConfig.limit_s": ("--seconds",),
    "LoopConfig.scans": ("--every",),
    "Rule.threshold_m": ("--threshold",),
    "Rule.within_s": ("--within",),
    "Question.lead_s": ("--lead",),
    "Question.horizon_s": ("--horizon",),
    "Question.at_s": ("--at",),
    "scan_height_m": ("--scan-height",),
}
# Whose fields are filled from options of their own name, else.
_FILLED = ("Recipe", "Plan", "LoopConfig", "Limits", "Rule", "Question", "Pace", "Dynamism",
           "Seeds", "Simulation", "World")  # fmt: skip
_FIELD = re.compile(rf"\b({'|'.join(_FILLED)})\.([a-z_]+)\b")
_FIRST = re.compile(r"^([a-z_]+)(?= must )")


class Verb(TyperCommand):
    """A command whose errors name its options, and whose help fits any terminal."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = flowing(self.help or "")

    def invoke(self, ctx: Any) -> Any:
        """Run it; ``InvalidValueError`` about a field becomes one about the option."""
        try:
            return super().invoke(ctx)
        except InvalidValueError as error:
            said = by_option(str(error), [name for one in self.params for name in one.opts])
            if said == str(error):
                raise
            raise InvalidValueError(said) from error


class ManyValues(Verb):
    """A command whose list options take all the words up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat each list option before every one of its words."""
        lists = {
            name
            for parameter in self.params
            if getattr(parameter, "multiple", False)
            for name in parameter.opts
        }
        return super().parse_args(ctx, repeated(args, lists))


def repeated(args: list[str], lists: set[str]) -> list[str]:
    """``args`` with the words after each option of ``lists`` given to that option one by one."""
    out: list[str] = []
    option, first = "", False  # the list option whose words these are; whether its first comes next
    for word in args:
        if word.startswith("-") and word != "-":
            option, first = (word, True) if word in lists else ("", False)
            out.append(word)
            continue
        out += [word] if first or not option else [option, word]
        first = False
    return out


def flowing(text: str) -> str:
    """Each paragraph as one line: rich keeps the line ends of the source, which are elsewhere."""
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


def by_option(
    message: str, options: Sequence[str], other: Mapping[str, tuple[str, ...]] = OPTIONS_OF
) -> str:
    """``message`` with "Recipe.seconds", or "seconds" at its start, as "--seconds".

    options  of the verb: names without one stay as they are
    other    options of fields that are called otherwise
    """

    def option(field: str, name: str) -> str:
        known = (*other.get(field, ()), f"--{name.replace('_', '-')}")
        return next((word for word in known if word in options), field)

    message = _FIELD.sub(lambda found: option(found[0], found[2]), message)
    return _FIRST.sub(lambda found: option(found[1], found[1]), message)
