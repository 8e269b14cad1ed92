# SPDX-License-Identifier: Apache-2.0
"""A verb is a ``spec``, a frozen dataclass: its fields are options, its docstring the help.

Who calls it runs it. An option is declared once, by ``option`` or ``argument``; a group of options
that several verbs have is a ``spec`` as well, which ``part`` puts among them. From that come help,
completion, the paths that are written, and the errors that name an option
(``scripts.option_names``).
"""

import inspect
import shlex
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cache, partial
from importlib import import_module
from typing import Any, TypeVar, dataclass_transform, get_type_hints

import typer

from slam.errors import InvalidValueError

T = TypeVar("T")
REQUIRED = MISSING
OF_TYPER = ("hidden", "show_default", "callback", "is_eager")  # passed on as they are


def names_of(*places: str) -> Callable[[str], list[str]]:
    """What a shell completes, from functions or tables of names: ``module:attribute``."""

    def complete(incomplete: str) -> list[str]:
        before, comma, begun = incomplete.rpartition(",")  # the last word of a list with commas
        names: list[str] = []
        for place in places:
            module, _, attribute = place.partition(":")
            known = getattr(import_module(module), attribute)
            names += known() if callable(known) else known
        return [before + comma + name for name in names if name.startswith(begun)]

    return complete


SCENES, SLAMS = names_of("scenes.registry:names"), names_of("slam.system:names")
SCANNERS = names_of("sim.sensors.lidar.registry:names")


@dataclass(frozen=True, kw_only=True)
class Option:
    """An option of a verb, or an argument.

    name, kind, default  of the field that it fills
    typed     what makes it one of typer's
    words     how it is typed, where that is not --name
    complete  ``SCENES`` and its like
    fills     fields of plans and configs that are called otherwise, such as ``Plan.slams``
    writes    whether it is a path that is written to; "file": and no folder
    choices   all that it may be, where these are few
    span      lowest and highest number, ``unit`` of them
    suffix    of the name of a file
    """

    name: str = ""
    kind: Any = str
    default: Any = None
    typed: Callable[..., Any] = typer.Option
    words: tuple[str, ...] = ()
    complete: Callable[[str], list[str]] | None = None
    fills: tuple[str, ...] = ()
    writes: bool | str = False
    choices: tuple[str, ...] = ()
    span: tuple[float, float] | None = None
    unit: str = ""
    suffix: str = ""

    @property
    def word(self) -> str:
        """How it is typed, and called in errors."""
        return self.words[0].partition("/")[0] if self.words else f"--{self.name.replace('_', '-')}"

    def parameter(self) -> inspect.Parameter:
        """Of the function that typer reads."""
        words = self.words
        if self.kind is bool and self.default is False and not words:
            words = (self.word,)  # without its --no-...
        default = ... if self.default is MISSING else self.default
        return inspect.Parameter(
            self.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=self.kind,
            default=self.typed(default, *words, autocompletion=self.complete),
        )  # fmt: skip

    def check(self, value: Any) -> None:
        """``InvalidValueError`` for a value that is given and cannot be."""
        if value is None:
            return
        wanted = ""
        if self.choices and value not in self.choices:
            wanted, value = f"be one of {', '.join(self.choices)}", f"{value!r:.80}"
        if self.span and not self.span[0] <= value <= self.span[1]:
            low, high = self.span
            ends = f"{low}..{high}" if self.kind is int else f"[{low:g}, {high:g}]"
            wanted = f"lie in {ends} {self.unit}".rstrip()
            value = value if self.kind is int else f"{value:g}"
        if self.suffix and value.suffix.lower() != self.suffix:
            wanted, value = f"be a file that ends in {self.suffix}", f"'{value}'"
        if wanted:
            raise InvalidValueError(f"{self.word} must {wanted}, got {value}")


def option(
    help: str,
    default: Any = None,
    *words: str,
    metavar: str | None = None,
    typed: Callable[..., Any] = typer.Option,
    **more: Any,
) -> Any:
    """A field that is an option of the command line, ``REQUIRED`` or with a default.

    more  of ``Option``, or one of ``OF_TYPER``
    """
    of_typer = {key: more.pop(key) for key in OF_TYPER if key in more}
    typed = partial(typed, help=help, metavar=metavar, **of_typer)
    return field(
        default=default, metadata={"is": Option(typed=typed, words=words, default=default, **more)}
    )


argument = partial(option, typed=typer.Argument)  # a word without a name before it


@dataclass_transform(frozen_default=True, kw_only_default=True)
def spec(kind: type[T]) -> type[T]:
    """A class of options, as a frozen dataclass."""
    return dataclass(frozen=True, kw_only=True)(kind)


def part(group: type, without: tuple[str, ...] = (), **changed: Any) -> Any:
    """A field of options: those of ``group`` but for some, with other defaults or texts."""
    given = {key: new.default if isinstance(new, Field) else new for key, new in changed.items()}
    return field(
        default_factory=partial(built, group, given), metadata={"is": (group, without, changed)}
    )


@cache
def options_of(kind: type) -> tuple[Option, ...]:
    """All options of a verb or of a group, in their order."""
    kinds, found = get_type_hints(kind), list[Option]()
    for one in fields(kind):
        about = one.metadata["is"]
        if isinstance(about, Option):
            found.append(replace(about, name=one.name, kind=kinds[one.name]))
            continue
        group, without, changed = about
        inner = [each for each in options_of(group) if each.name not in without]
        found += [_changed(each, changed[each.name]) if each.name in changed else each
                  for each in inner]  # fmt: skip
    return tuple(found)


def _changed(one: Option, new: Any) -> Option:
    if not isinstance(new, Field):
        return replace(one, default=new)
    about: Option = new.metadata["is"]
    return replace(about, name=one.name, kind=one.kind)


def built(kind: type, given: Mapping[str, Any]) -> Any:
    """A spec of options by name, those of its groups among them."""
    own = {}
    for one in fields(kind):
        about = one.metadata["is"]
        if not isinstance(about, Option):
            own[one.name] = built(about[0], given)
        elif one.name in given:
            own[one.name] = given[one.name]
    return kind(**own)


def command(kind: type) -> Callable[..., None]:
    """The function that typer makes a verb of: from the options to a spec, which it calls."""
    options = options_of(kind)
    signature = inspect.Signature([one.parameter() for one in options])

    def call(*words: Any, **named: Any) -> None:
        given = signature.bind(*words, **named).arguments
        values = {one.name: given.get(one.name, one.default) for one in options}
        for one in options:
            one.check(values[one.name])
        built(kind, values)()

    call.__doc__ = kind.__doc__
    vars(call).update(__signature__=signature, options=options)
    return call


def spec_of(verb: str) -> type:
    """``Name`` in ``scripts.verbs.name``; ``list`` would hide the built-in type."""
    own = {"list": "listing"}.get(verb, verb).replace("-", "_")
    found: type = getattr(import_module(f"scripts.verbs.{own}"), own.title().replace("_", ""))
    return found


def command_line(verb: str, **given: Any) -> str:
    """What to type for a verb with these of its options, to be copied; None and False are not
    given.

    Raises ``KeyError`` for an option that it does not have, ``InvalidValueError`` as typing it.
    """
    options = {one.name: one for one in options_of(spec_of(verb))}
    words, after = ["mobilia", verb], list[str]()
    for name, value in given.items():
        one = options[name]
        one.check(value)
        if value is None or value is False:
            continue
        several = value if isinstance(value, list | tuple) else [value]
        texts = [] if value is True else [_text(each) for each in several]
        if one.typed.func is typer.Argument:  # type: ignore[attr-defined]
            words += texts
        else:
            after += [one.word, *texts]
    return shlex.join([*words, *after])


def _text(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)
