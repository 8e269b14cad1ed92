# SPDX-License-Identifier: Apache-2.0
"""A verb is made from its dataclass: options in their order, groups in their place, bounds told."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from scripts.option_names import Verb
from scripts.spec import REQUIRED, argument, command, option, options_of, part, spec
from slam.errors import InvalidValueError
from tests.help_of_all import help_of_all


@spec
class Room:
    seconds: float = option("Length, s.", 60.0)
    seed: int = option("Seed.", 0)
    crowd: str | None = option("Who.")


SEEN: list["Drive"] = []


@spec
class Drive:
    """Drive."""

    scene: str = argument("Where.", REQUIRED)
    room: Room = part(Room, without=("crowd",), seed=7, seconds=option("How long, s.", 9.0))
    to: str = option("What.", "a", choices=("a", "b"))
    port: int = option("Port.", 1, span=(0, 9))
    speed: float = option("Speed.", 1.0, span=(0.5, 20.0), unit="m/s")
    film: Path | None = option("Film.", suffix=".mp4", writes=True)
    loud: bool = option("Loud.", False)

    def __call__(self) -> None:
        SEEN.append(self)


def test_groups_stand_in_their_place_with_their_own_defaults():
    names = [one.name for one in options_of(Drive)]
    assert names == ["scene", "seconds", "seed", "to", "port", "speed", "film", "loud"]
    drive = command(Drive)
    drive("office", seconds=3.0)
    assert SEEN[-1] == Drive(scene="office", room=Room(seconds=3.0, seed=7))
    assert Drive(scene="office").room == Room(seconds=9.0, seed=7)


def test_the_command_line_fills_the_spec():
    app = typer.Typer()
    app.command(cls=Verb)(command(Drive))
    done = CliRunner().invoke(app, ["office", "--seed", "3", "--loud", "--film", "f.mp4"])
    assert done.exit_code == 0, done.output
    room = Room(seconds=9.0, seed=3)
    assert SEEN[-1] == Drive(scene="office", room=room, loud=True, film=Path("f.mp4"))
    for wrong in ([], ["office", "--no-loud"]):  # without what is required; no such option
        assert isinstance(CliRunner().invoke(app, wrong).exception, InvalidValueError)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"to": "c"}, "--to must be one of a, b, got 'c'"),
        ({"port": 10}, r"--port must lie in 0\.\.9, got 10"),
        ({"speed": 21.0}, r"--speed must lie in \[0\.5, 20\] m/s, got 21"),
        ({"film": Path("f.avi")}, r"--film must be a file that ends in \.mp4, got 'f\.avi'"),
    ],
)
def test_what_cannot_be_is_said_by_its_option(given, said):
    with pytest.raises(InvalidValueError, match=said):
        command(Drive)("office", **given)


def test_every_help_is_printed():
    text = help_of_all(Path(__file__).resolve().parents[2])
    assert {"$ mobilia run --help", "$ mobilia scene from-log --help"} <= set(text.splitlines())
    assert "--first-seconds" in text
