# SPDX-License-Identifier: Apache-2.0
"""Numbers with an address: checked, set by path, named by a digest; and every one of ours."""

import importlib
import json
import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

import slam
from slam.errors import InvalidValueError, UnknownNameError
from slam.settings import Row, Settings, number, word

ROOT = Path(slam.__file__).parent
CONFIGURABLE = [name for name in slam.names() if slam.config_of(name) is not None]


@dataclass(frozen=True, kw_only=True)
class Inner(Settings):
    count: int = number(3, "items", "how many", low=1, high=9)
    kept: float = number(0.5, "share", "in a kernel", fixed=True)


@dataclass(frozen=True, kw_only=True)
class Outer(Settings):
    size_m: float = number(2.0, "m", "how large", low=0.0, high=10.0, alias="inner.size_m")
    kind: str = word("a", ("a", "b"), "which")
    inner: Inner = field(default=Inner())


def default_of(name: str) -> Settings:
    found = slam.config_of(name)
    assert found is not None
    return found[1]


def other(row: Row) -> Any:
    """Another value that the number may have."""
    about, value = row.about, row.value
    if about.options:
        return next(option for option in about.options if option != value)
    if isinstance(value, int):
        return value + 1 if value < about.high else value - 1
    if about.low <= (nearer := value * 0.99) != value:
        return nearer
    return value + 0.01 * (min(about.high, 1.0) - value)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"size_m": True}, "Outer.size_m must be a number, got True"),
        ({"size_m": "1"}, "Outer.size_m must be a number, got '1'"),
        ({"size_m": math.nan}, "Outer.size_m must be a number, got nan"),
        ({"size_m": 10.1}, r"Outer.size_m must lie in \[0.0, 10.0\], got 10.1"),
        ({"kind": "c"}, "Outer.kind must be 'a' or 'b', got 'c'"),
        ({"inner.count": 2.5}, "Inner.count must be a whole number, got 2.5"),
        ({"inner.count": 0}, "Inner.count must lie in"),
        ({"inner.kept": 0.4}, "'inner.kept' is fixed at 0.5"),
        ({"size_m": 1.0, "inner.size_m": 2.0}, "'size_m' is set twice"),
    ],
)
def test_a_value_that_cannot_be_is_refused_by_name(changes: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidValueError, match=match):
        Outer().changed(changes)


def test_a_group_is_no_number_and_a_number_no_group() -> None:
    with pytest.raises(InvalidValueError, match=r"Outer.inner must be a Inner, got 3"):
        replace(Outer(), inner=3)  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match=r"Inner.kept is fixed at 0.5, got 0.25"):
        Inner(kept=0.25)
    for words in ([], {"inner": 1}, {"inner": {"size": 1}}):
        with pytest.raises(InvalidValueError):
            Outer.from_words(words)


def test_numbers_are_set_by_path_alias_or_not_at_all() -> None:
    tree = Outer().changed({"inner.count": 4, "inner.size_m": 1})
    assert tree == Outer(size_m=1.0, inner=Inner(count=4))
    assert tree.differences(Outer()) == {"size_m": 1.0, "inner.count": 4}
    assert type(tree.size_m) is float
    for path, near in (("inner.cuont", "inner.count"), ("count", "inner.count")):
        with pytest.raises(UnknownNameError, match=f"no '{path}'. Did you mean '{near}'"):
            tree.changed({path: 1})
    with pytest.raises(UnknownNameError, match="Outer has no 'zzzzzz'"):
        tree.changed({"zzzzzz": 1})


@pytest.mark.parametrize("name", CONFIGURABLE)
def test_a_tree_comes_back_from_json(name: str) -> None:
    tree = default_of(name)
    assert type(tree).from_words(json.loads(json.dumps(tree.as_words()))) == tree
    assert type(tree).from_words({}) == tree


@pytest.mark.parametrize("name", CONFIGURABLE)
def test_the_digest_changes_with_every_number_that_can_be_set(name: str) -> None:
    tree = default_of(name)
    free = [row for row in tree.rows() if not row.about.fixed]
    digests = {tree.changed({row.path: other(row)}).sha256() for row in free}
    assert len(digests | {tree.sha256()}) == len(free) + 1


@pytest.mark.parametrize("name", CONFIGURABLE)
def test_every_number_has_unit_meaning_source_and_bounds(name: str) -> None:
    rows = list(default_of(name).rows())
    assert len(rows) > 4
    assert sum(row.about.fixed for row in rows) <= 6  # the way out for compiled kernels
    for row in rows:
        about = row.about
        assert about.unit, row.path
        assert about.meaning, row.path
        assert about.source, row.path
        assert about.options or about.low < about.high < math.inf, row.path
        assert not about.meaning.endswith("."), row.path


def test_every_number_is_read_where_something_is_computed() -> None:
    """By the name of its field, outside the files that only list the numbers."""
    lists = {"config.py", "settings.py"}
    files = [path for path in ROOT.rglob("*.py") if path.name not in lists]
    read = set(re.findall(r"\.([a-z_0-9]+)\b", "\n".join(path.read_text() for path in files)))
    read |= set(re.findall(r"self\.([a-z_0-9]+)\b", (ROOT / "frontend/config.py").read_text()))
    read |= set(re.findall(r"self\.([a-z_0-9]+)\b", (ROOT / "ekf/config.py").read_text()))
    read |= {"damping_falls", "damping_grows", "damping_least", "damping_again", "damping_most"}
    ours = [name for name in CONFIGURABLE if ".guests." not in slam.system.OWN[name]]
    for name in ours:  # a guest's go to its package, by their names
        for row in default_of(name).rows():
            assert row.path.rpartition(".")[2] in read, row.path


@pytest.mark.parametrize(
    "path",
    [
        "frontend.spacing_m", "frontend.surfaces.slack", "frontend.view.silent_m",
        "frontend.prior.twist_s", "frontend.bias.lasts_s", "features.corners.cell_m",
    ],
)  # fmt: skip
def test_a_number_that_is_a_constant_now_says_where(path: str) -> None:
    with pytest.raises(UnknownNameError, match="a constant now") as refused:
        default_of("shunting").changed({path: 1.0})
    constant, home = re.findall(r"([A-Z_]+) of (slam[a-z_.]+)", str(refused.value))[0]
    assert isinstance(getattr(importlib.import_module(home), constant), float)
