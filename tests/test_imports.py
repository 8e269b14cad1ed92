# SPDX-License-Identifier: Apache-2.0
"""Who imports whom, within functions too: no file goes round, no package beside another either."""

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("slam", "sim", "scenes", "scripts")
CONTESTANTS = ("slam.shunting", "slam.ekf", "slam.grid", "slam.guests")


@cache
def files() -> Mapping[str, Path]:
    """Every file by its dotted name."""
    found = {}
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Every node but those that are there for the type checker only."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node
        yield from statements(node)


def imported(path: Path) -> set[str]:
    """Which files of ours the file at ``path`` imports."""
    found = set[str]()
    for node in statements(ast.parse(path.read_bytes())):
        words: list[str] = []
        if isinstance(node, ast.Import):
            words = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            words = [f"{node.module}.{alias.name}" for alias in node.names]
        for word in words:
            while word and word not in files():
                word = word.rpartition(".")[0]
            found.update({word} - {""})
    return found


@cache
def imports() -> Mapping[str, set[str]]:
    """Which files of ours each file of ours imports."""
    return {name: imported(path) - {name} for name, path in files().items()}


def folder(name: str) -> str:
    return name if files()[name].name == "__init__.py" else name.rpartition(".")[0]


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def test_no_file_imports_itself_round_about():
    assert len(list(TopologicalSorter(imports()).static_order())) == len(files())


def test_no_package_imports_one_beside_it_that_imports_it():
    graph: dict[str, set[str]] = {}
    for name, found in imports().items():
        mine = folder(name)
        others = (folder(other) for other in found)
        apart = {other for other in others if not within(mine, other) and not within(other, mine)}
        graph.setdefault(mine, set()).update(apart)
    assert set(TopologicalSorter(graph).static_order()) == set(graph)


def test_no_contestant_imports_another():
    for name, found in imports().items():
        for mine in (own for own in CONTESTANTS if within(name, own)):
            for other in (c for c in CONTESTANTS if c != mine):
                assert not [word for word in found if within(word, other)], name


def test_arrows_point_down():
    for name, found in imports().items():
        allowed = {"slam": 1, "scenes": 2, "sim": 3, "scripts": 4}
        rank = allowed[name.partition(".")[0]]
        for other in found:
            assert allowed[other.partition(".")[0]] <= rank, f"{name} imports {other}"


def test_only_the_command_line_imports_verbs():
    """And what tries whole commands: a verb parses, calls and prints, and is no part of another."""
    above = ("scripts.cli", "scripts.verbs")
    for name, found in imports().items():
        if not any(within(name, own) for own in above):
            assert not [word for word in found if within(word, "scripts.verbs")], name


def test_no_test_of_slam_imports_what_is_above():
    for path in (ROOT / "tests" / "slam").rglob("*.py"):
        assert not [name for name in imported(path) if within(name, "scripts")], path
