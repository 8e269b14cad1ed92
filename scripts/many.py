# SPDX-License-Identifier: Apache-2.0
"""Options that take several words: ``--slam a b c`` is ``--slam a --slam b --slam c``."""

from __future__ import annotations

import re
from typing import Any

from scripts.option_names import Verb
from slam.variants import ORACLE, PIPE

BETWEEN = re.compile(r",(?![^{]*\}|[^(]*\))")  # a comma outside braces and brackets


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


def named(values: list[str]) -> tuple[str, ...]:
    """Words may also be joined by commas, but for the command of a pipe, which may hold some, and
    inside the braces of a variant and the brackets of an oracle."""
    whole = (PIPE, ORACLE + PIPE)
    parts = ([value] if value.startswith(whole) else BETWEEN.split(value) for value in values)
    return tuple(word for words in parts for word in words if word)
