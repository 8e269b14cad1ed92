# SPDX-License-Identifier: Apache-2.0
"""Docstrings as Markdown.

Ours name fields in columns, which is easy to read in code:

    width, height  px
    shadows        of the sun; half the cost
                   on a CPU

Markdown would run these lines together, so they become a list.
"""

import re

_NAME = r"[\w*.]+(?:/\w+)?(?:, [\w*.]+)*"
_ROW = re.compile(rf"({_NAME}) {{2,}}(\S.*)")
_EXAMPLE = re.compile(r" {4,}\S")


def as_markdown(text: str) -> str:
    """The text with its columns as lists, and with an empty line before an indented example."""
    lines, out = text.splitlines(), [""]
    while lines:
        line = lines.pop(0)
        row = _ROW.fullmatch(line)
        if row is None:
            if _EXAMPLE.match(line) and out[-1].strip() and not _EXAMPLE.match(out[-1]):
                out.append("")
            out.append(line)
            continue
        words = [row[2]]
        while lines and lines[0].startswith(" ") and lines[0].strip():
            words.append(lines.pop(0).strip())
        if out[-1].strip() and not out[-1].startswith("- "):
            out.append("")
        names = ", ".join(f"`{name}`" for name in row[1].split(", "))
        out.append(f"- {names}: {' '.join(words)}")
    return "\n".join(out[1:])
