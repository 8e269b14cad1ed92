# SPDX-License-Identifier: Apache-2.0
"""How a command line is read: lists of words, errors that name options, what is read only."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

from typer import BadParameter
from typer.core import TyperCommand, TyperGroup

from scripts.spec import Option
from slam import inputs
from slam.errors import InvalidValueError
from slam.files import refuse_unwritable

UsageError: Any = BadParameter.__base__  # which typer does not name
WORDS = "mobilia.words"  # of the command line, in a context
# Whose fields are filled from options of their own name, where the options do not say otherwise.
_FILLED = ("Recipe", "Plan", "LoopConfig", "Limits", "Rule", "Question", "Pace", "Dynamism",
           "Seeds", "Session", "Simulation", "World", "FromMap")  # fmt: skip
_FIELD = re.compile(rf"\b({'|'.join(_FILLED)})\.([a-z_]+)\b")
_FIRST = re.compile(r"^([a-z_]+)(?=(?:\[\d+\]\.\w+)? must )")


class Verbs(TyperGroup):
    """A group of commands that says in one line what it does not know; ``InvalidValueError``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer's, of its own options."""
        with _in_one_line(ctx):
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """As typer's: finds the command and runs it."""
        with _in_one_line(ctx):
            return super().invoke(ctx)


@contextmanager
def _in_one_line(ctx: Any) -> Iterator[None]:
    try:
        yield
    except UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # the whole help, which was asked for
            raise
        said, group = error.format_message().rstrip("."), f" {ctx.info_name}" if ctx.parent else ""
        more = "" if said.endswith("?") else f". What there is: mobilia{group} --help"
        raise InvalidValueError(said + more) from error


class Verb(TyperCommand):
    """A command whose list options take all the words up to the next option, whose names a shell
    completes, whose errors name its options, whose help fits any terminal, and which never writes
    over what it is given to read."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = flowing(self.help or "")
        self.options: Sequence[Option] = getattr(self.callback, "options", ())

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

    def make_context(self, info_name: Any, args: list[str], parent: Any = None, **more: Any) -> Any:
        """As typer's; ``InvalidValueError`` in one line for what cannot be read."""
        words = [part for word in args for part in word.split("=", 1)]
        try:
            return super().make_context(info_name, args, parent, **more)
        except UsageError as error:
            group = f"{parent.info_name} " if parent and parent.parent else ""
            verb = f"mobilia {group}{info_name}"
            raise InvalidValueError(self._unread(error, words, verb)) from error

    def _unread(self, error: Any, words: Sequence[str], verb: str) -> str:
        """What is wrong: the option, the value and what was expected."""
        typed: Sequence[str] = getattr(getattr(error, "param", None), "opts", ())
        kind = next((str(one.kind) for one in self.options if one.word in typed), "")
        value = next((after for word, after in pairwise(words) if word in typed), None)
        if value is not None and ("int" in kind or "float" in kind):
            number = "a whole number" if "int" in kind else "a number"
            return f"{typed[0]} must be {number}, got {value!r:.80}"
        return f"{error.format_message().rstrip('.')}. What there is: {verb} --help"

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
            typed = {one.name: one.opts for one in self.params}
            fills = {field: typed[one.name][0] for one in self.options for field in one.fills}
            said = by_option(str(error), [name for opts in typed.values() for name in opts], fills)
            if said == str(error):
                raise
            raise InvalidValueError(said) from error

    def _note_inputs(self, given: Mapping[str, Any]) -> None:
        """A scene's name, say, that a folder happens to have, is not that folder."""
        written = []
        about = {one.name: one for one in self.options}
        for name, value in given.items():
            option = about.get(name, Option())
            for word in value if isinstance(value, (list, tuple)) else [value]:
                if not isinstance(word, (str, Path)) or not str(word):
                    continue
                if option.writes:
                    written.append(Path(word))
                    refuse_unwritable(Path(word))
                    if option.writes == "file" and os.path.isdir(word):
                        raise InvalidValueError(f"{option.word} must be a file, got folder {word}")
                elif not (option.complete and os.path.isdir(word)):
                    inputs.note(Path(word))
        inputs.refuse(*written)


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


def by_option(message: str, options: Sequence[str], fills: Mapping[str, str]) -> str:
    """``message`` with "Recipe.seconds", "Rule.within_s", or such a name at its start, as options.

    options  of the verb: names without one stay as they are
    fills    options of fields that are called otherwise
    """

    def option(field: str, name: str) -> str:
        own = f"--{name.replace('_', '-')}"
        known = (fills.get(field, own), own.removesuffix("-s").removesuffix("-m"))
        return next((word for word in known if word in options), field)

    message = _FIELD.sub(lambda found: option(found[0], found[2]), message)
    return _FIRST.sub(lambda found: option(found[1], found[1]), message)
