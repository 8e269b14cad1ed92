# SPDX-License-Identifier: Apache-2.0
"""A space on file: what is searched, what is refused, and how a SLAM gets its numbers."""

import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scripts.names import file_name
from scripts.tuning.space import Searched, read, variant
from slam.errors import LogFormatError
from slam.guests import PipeSlam
from slam.system import create


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "space.toml"
    path.write_text(text)
    return path


def test_paths_may_be_nested_as_toml_nests_them(tmp_path: Path):
    text = (
        "[numbers]\nmatching.local.points = {low = 60, high = 360, int = true}\n"
        'objective = {choices = ["sum", "log"]}\n'
        '"matching.reward" = {low = 1, high = 9, log = true}'
    )
    space = read(written(tmp_path, text), "shunting")
    assert list(space) == ["matching.local.points", "objective", "matching.reward"]
    assert [one.ends for one in space.values()] == [(60, 360), ("sum", "log"), (1.0, 9.0)]


@pytest.mark.parametrize(
    ("slam", "text", "said"),
    [
        ("karto", "[numbers]", "1 to 50 numbers, got 0"),
        ("karto", "[number]", "Did you mean 'numbers'"),
        ("karto", "[numbers", "is no TOML"),
        ("karto", "numbers = {search_size = 7}", "search_size must be a table, got 7"),
        ("karto", "numbers = {serch_size = {low = 0.1, high = 1}}", "Did you mean 'search_size'"),
        ("karto", "numbers = {search_size = {low = 1, high = 0.1}}", "low must be below high"),
        ("karto", "numbers = {search_size = {low = 0.1}}", "needs low and high, or choices"),
        ("karto", "numbers = {search_size = {low = 0.1, high = 99}}", "must lie in [0.02, 5.0]"),
        ("karto", "numbers = {keep_m = {low = 0, high = 1, log = true}}", "must be > 0 with log"),
        ("karto", "numbers = {keep_m = {low = 0.1, high = 1, int = true}}", "whole with int"),
        ("karto", "numbers = {keep_m = {low = 0.1, high = nan}}", "a finite number"),
        ("kiss-icp", "numbers = {max_points_per_voxel = {low = 1, high = 9}}", "a whole number"),
        ("karto", "numbers = {keep_m = {choices = [1], low = 1}}", "a list of 2 to 100 values"),
        ("karto", "numbers = {keep_m = {choices = [1, 2], low = 1}}", "choices alone"),
        ("shunting", 'numbers = {objective = {choices = ["sum", "a,b"]}}', "matches"),
        ("odometry", "numbers = {gain = {low = 1, high = 2}}", "'odometry' has no numbers to set"),
        ("pipe:x", 'numbers = {"a b" = {low = 1, high = 2}}', "no name of an environment variable"),
    ],
)
def test_what_cannot_be_is_one_line_with_the_file(tmp_path: Path, slam: str, text: str, said: str):
    with pytest.raises(LogFormatError) as raised:
        read(written(tmp_path, text), slam)
    assert said in str(raised.value)
    assert str(raised.value).startswith(str(tmp_path / "space.toml"))


@given(low=st.floats(1e-6, 1e6), factor=st.floats(1.0001, 1e4), at=st.floats(0.0, 1.0))
def test_a_number_that_is_tried_is_short_and_between_the_bounds(low, factor, at):
    one = Searched(low=low, high=low * factor)
    value = one.rounded(low + at * (low * factor - low))
    assert one.ends[0] <= value <= one.ends[1]
    assert value in one.ends or value == float(f"{value:.4g}")


def test_numbers_go_into_names_oracles_and_environments():
    assert variant("karto{keep_m=0.5}", {"search_size": 0.4}) == "karto{keep_m=0.5,search_size=0.4}"
    assert variant("oracle(ekf)", {"detection": 0.8}) == "oracle(ekf{detection=0.8})"
    assert variant("pipe:./a -b", {"X": 7, "Y": True}) == "pipe:env X=7 Y=true ./a -b"


def test_a_name_with_many_numbers_is_that_of_a_file_too():
    names = [variant("ekf", {f"a_long_name_{k}": at for k in range(20)}) for at in (1, 2)]
    files = [file_name(name) for name in names]
    assert max(map(len, files)) < 150
    assert files[0] != files[1]
    assert file_name("my_pkg:MySlam") == "my_pkg-MySlam"


def test_a_program_gets_its_numbers():
    program = f"sh -c 'test $GAIN = 7 && exec {sys.executable} -m slam.guests.serve odometry'"
    system = create(variant(f"pipe:{program}", {"GAIN": 7}))
    assert isinstance(system, PipeSlam)
    system.close()
