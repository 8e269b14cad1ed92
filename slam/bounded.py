# SPDX-License-Identifier: Apache-2.0
"""Files read whole, once their size is known to be one that such a file may have."""

import json
import stat
import tomllib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path
from typing import Any

from slam.errors import LogFormatError


def check_file(path: Path) -> None:
    """``LogFormatError`` for what is no file: a named pipe, once opened, would wait for ever."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise LogFormatError(path, "cannot be read: not a file")
    except (OSError, ValueError) as error:  # the last: a null byte in the name
        why = getattr(error, "strerror", None) or error
        raise LogFormatError(path, f"cannot be read: {why}") from error


def beside(file: Path, name: str) -> Path:
    """The path of what ``file`` names, in its folder or below.

    ``LogFormatError`` for a name or a link that leads out of it.
    """
    path, folder = file.parent / name, file.parent
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # links in a circle, a null byte
        inside = False
    if Path(name).is_absolute() or ".." in Path(name).parts or not inside:
        raise LogFormatError(file, f"names the file {name!r:.80}, expected one beside it")
    return path


def bytes_of(path: Path, most: int) -> bytes:
    """``path.read_bytes``; ``LogFormatError`` unless it is a file of at most ``most`` bytes."""
    check_file(path)
    try:
        size = path.stat().st_size
        if size > most:
            raise LogFormatError(path, f"has {size} bytes; at most {most} are allowed")
        return path.read_bytes()
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error


def text_of(path: Path, most: int) -> str:
    """The same as text, in UTF-8 or as a byte-order mark says; ``LogFormatError`` for no text."""
    data = bytes_of(path, most)
    marked = data.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
    try:
        return data.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError as error:
        why = f"byte {error.start} is no {error.encoding.upper()}"
        raise LogFormatError(path, f"not a text file: {why}; save it as UTF-8") from error


def toml_of(path: Path, most: int) -> dict[str, Any]:
    """The tables of a TOML file; ``LogFormatError`` where it is none."""
    try:
        return tomllib.loads(text_of(path, most))
    except (ValueError, RecursionError) as error:  # a number of too many digits, too
        raise LogFormatError(path, f"is no TOML: {error}") from error


def yaml_in(path: Path, text: str, what: str) -> dict[str, str | list[str | None] | None]:
    """The fields of a YAML document, which may be JSON, every value as its text.

    Lists hold values alone. None is what is nested deeper: it is never built, so no tag has a
    meaning and no alias makes the text more than it is. ``LogFormatError`` for what is no ``what``.
    """
    from ruamel.yaml import YAML, MappingNode, ScalarNode, SequenceNode
    from ruamel.yaml.error import YAMLError

    def plain(node: object) -> str | None:
        return node.value if isinstance(node, ScalarNode) else None

    try:
        # the library takes no tabs between words, as YAML and map_server do
        root = YAML(typ="base", pure=True).compose(text.replace("\t", " "))
    except (YAMLError, ValueError, ArithmeticError, AssertionError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        said = (getattr(error, "context", None), getattr(error, "problem", None) or error)
        why = ", ".join(str(words).partition("\n")[0] for words in said if words)
        raise LogFormatError(path, f"is no YAML: {why:.200}", mark and mark.line + 1) from error
    if not isinstance(root, MappingNode):
        raise LogFormatError(path, f"no {what}: expected lines of 'key: value'")
    found: dict[str, str | list[str | None] | None] = {}
    for key, value in root.value:
        name, line = plain(key), key.start_mark.line + 1
        if name is None or name in found:
            why = "a key that is no word" if name is None else f"{name!r:.80} twice"
            raise LogFormatError(path, f"no {what}: it has {why}", line)
        several = isinstance(value, SequenceNode)
        found[name] = [plain(each) for each in value.value] if several else plain(value)
    return found


def json_of(path: Path, most: int, what: str, *, strict: bool = True) -> dict[str, Any]:
    """The object of a JSON file; ``LogFormatError`` for what is no ``what``.

    strict  Infinity and NaN, which are no JSON, are refused
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no JSON number")

    try:
        data = json.loads(text_of(path, most), parse_constant=refuse if strict else None)
    except (ValueError, RecursionError) as error:
        raise LogFormatError(path, f"no {what}: {error}") from error
    if not isinstance(data, dict):
        raise LogFormatError(path, f"no {what}: not a JSON object")
    return data
