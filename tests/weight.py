# SPDX-License-Identifier: Apache-2.0
"""How heavy the project is: ``python -m tests.weight [FOLDER ...]``, other checkouts beside it.

Lines of Python by package and how many of them are code, the longest file, short files, the mean
length of a line and the share of comments and docstrings (what a line count can be packed with),
settings of the SLAMs, and words of the pages. A line counts as a line of the file, blank ones too;
one of code holds a token that is no comment and no docstring. The mean is of lines not blank.
"""

import ast
import io
import json
import subprocess
import sys
import tokenize
from pathlib import Path

from tests.test_imports import ROOT

SOURCE = ("slam", "sim", "scenes", "scripts", "mobilia")
SHORT = 25  # lines; a file with fewer is no room of its own


def python(root: Path, package: str) -> list[Path]:
    """Python files of a package, sorted."""
    return sorted((root / package).rglob("*.py"))


def lines(paths: list[Path]) -> list[str]:
    """All lines of these files."""
    return [line for path in paths for line in path.read_text(encoding="utf-8").splitlines()]


NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENDMARKER,
}  # fmt: skip
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def code_and_words(path: Path) -> tuple[int, int]:
    """Lines with code; lines that are only a comment, or part of a docstring."""
    text = path.read_text(encoding="utf-8")
    words = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None
        for line in range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
    }
    code: set[int] = set()
    comments: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments.add(token.start[0])
        elif token.type not in NO_CODE:
            code.update(range(token.start[0], token.end[0] + 1))
    code -= words
    return len(code), len(words | (comments - code))


def settings(root: Path, slam: str) -> int:
    """Numbers of a SLAM that ``mobilia config`` lists."""
    words = [sys.executable, "-m", "scripts", "config", slam, "--json"]
    made = subprocess.run(words, cwd=root, capture_output=True, check=True)
    return len(json.loads(made.stdout)["numbers"])


def weigh(root: Path) -> dict[str, str]:
    """All figures of a checkout, by name."""
    packages = {name: python(root, name) for name in (*SOURCE, "tests")}
    source = [path for name in SOURCE for path in packages[name]]
    counted = {path: code_and_words(path) for paths in packages.values() for path in paths}
    code = {name: sum(counted[path][0] for path in paths) for name, paths in packages.items()}
    in_all = sum(code[name] for name in SOURCE)
    length = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in source}
    longest = max(length, key=lambda path: length[path])
    full = [line for line in lines(source) if line.strip()]
    pages = sorted((root / "docs").rglob("*.md"))
    short = [path for path in source if length[path] < SHORT and path.name != "__init__.py"]
    return {
        **{
            name: f"{len(lines(paths))} lines, {code[name]} of code"
            for name, paths in packages.items()
        },
        "source": f"{sum(length.values())} lines in {len(source)} files, {in_all} of code",
        "longest file": f"{length[longest]} {longest.relative_to(root)}",
        f"files below {SHORT} lines": f"{len(short)}",
        "mean line": f"{sum(map(len, full)) / len(full):.1f} characters",
        "comments": f"{100 * sum(counted[path][1] for path in source) / len(full):.1f} %",
        **{f"settings of {slam}": f"{settings(root, slam)}" for slam in ("shunting", "occupancy")},
        "docs": f"{sum(len(page.read_text(encoding='utf-8').split()) for page in pages)} words",
    }


if __name__ == "__main__":
    weights = [weigh(root) for root in (*map(Path, sys.argv[1:]), ROOT)]
    for name in weights[0]:
        print(f"{name:24}" + "".join(f"{weight[name]:>40}" for weight in weights))
