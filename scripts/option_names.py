# SPDX-License-Identifier: Apache-2.0
"""How a command line is read: lists, names that a shell completes, errors that name options."""

import os
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from slam import inputs
from slam.errors import InvalidValueError

WORDS = "mobilia.words"  # of the command line, in a context
# Fields that are called otherwise than their option; of several the first that the verb has.
OPTIONS_OF: dict[str, tuple[str, ...]] = {
    "Plan.slams": ("--slam",),
    "Plan.scenes": ("--scene", "scene"),
    "Plan.levels": ("--dynamism",),
    "Plan.dynamisms": ("--dynamism",),
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


# What a shell offers for an argument or option of that name.
COMPLETED: dict[str, tuple[str, ...]] = {
    "scene": ("scenes.registry:names",), "slam": ("slam.system:names",),
    "subject": ("slam.system:names",), "oracle": ("slam.system:names",),
    "scanner": ("sim.sensors.lidar.registry:names",),
    "tracks": ("scripts.benchmark.tracks:TRACKS",),
    "what": ("slam.system:names", "sim.sensors.lidar.registry:names"),
}  # fmt: skip


WRITTEN = ("out", "strip_to", "replay", "page", "map_out")  # options that say where to


class Verb(TyperCommand):
    """A command whose list options take all the words up to the next option, whose names a shell
    completes, whose errors name its options, whose help fits any terminal, and which never writes
    over what it is given to read."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = flowing(self.help or "")
        for parameter in self.params:
            if parameter.name in COMPLETED:
                parameter._custom_shell_complete = completed

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat each list option before every one of its words."""
        lists = {
            name
            for parameter in self.params
            if getattr(parameter, "multiple", False)
            for name in parameter.opts
        }
        ctx.meta[WORDS] = args
        return super().parse_args(ctx, repeated(args, lists))

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """The second and later words of a list are completed as its first is."""
        options = [word for word in ctx.meta.get(WORDS, ()) if word.startswith("-")]
        for parameter in self.params if options else ():
            if options[-1] in parameter.opts and getattr(parameter, "multiple", False):
                return parameter.shell_complete(ctx, incomplete)
        return super().shell_complete(ctx, incomplete)

    def invoke(self, ctx: Any) -> Any:
        """Run it; ``InvalidValueError`` about a field becomes one about the option.

        Raises ``OutputError`` where it is to write to what it reads.
        """
        try:
            with inputs.of_one_command():
                self._note_inputs(ctx.params)
                return super().invoke(ctx)
        except InvalidValueError as error:
            said = by_option(str(error), [name for one in self.params for name in one.opts])
            if said == str(error):
                raise
            raise InvalidValueError(said) from error

    def _note_inputs(self, given: Mapping[str, Any]) -> None:
        """A scene's name, say, that a folder happens to have, is not that folder."""
        words = [
            (name, Path(word))
            for name, value in given.items()
            for word in (value if isinstance(value, (list, tuple)) else [value])
            if isinstance(word, (str, Path)) and str(word)
        ]
        for name, path in words:
            if name not in WRITTEN and not (name in COMPLETED and os.path.isdir(path)):
                inputs.note(path)
        inputs.refuse(*(path for name, path in words if name in WRITTEN))


def completed(_ctx: Any, parameter: Any, incomplete: str) -> list[str]:
    """Names that go on as the last word of a list with commas begins."""
    before, comma, begun = incomplete.rpartition(",")
    names: list[str] = []
    for where in COMPLETED[parameter.name]:
        module, _, attribute = where.partition(":")
        known = getattr(import_module(module), attribute)
        names += known() if callable(known) else known
    return [before + comma + name for name in names if name.startswith(begun)]


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
