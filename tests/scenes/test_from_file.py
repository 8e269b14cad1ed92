# SPDX-License-Identifier: Apache-2.0
"""Scenes drawn in TOML: what they hold, and what is said of those that are wrong."""

import os
import re

import pytest

import scenes
from scripts.scene.check import problems
from scripts.scene.make import contents
from sim.simulation import Simulation
from slam.errors import InvalidValueError, MobiliaError

LAB = """\
walls = [
  [[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]],
  [[4, 0], [4, 2]], [[4, 2.98], [4, 5]],
]
start = [1, 1, 90]
goals = [[1.5, 4], [6, 1]]
hinges = [[4, 2.02, 90, "left"]]
put = [["desk", 6.5, 4.4, 0], ["chair_swivel", 2, 2.8, 90]]
n_people = 1
"""


@pytest.fixture
def lab(tmp_path):
    """Writes a scene's file; gives its name."""

    def written(text: str) -> str:
        path = tmp_path / "lab.toml"
        path.write_text(text)
        return str(path)

    return written


def test_a_drawn_plan_has_what_it_says(lab):
    scene = scenes.build(lab(LAB), 3, n_chairs=1)
    assert [m.kind for m in scene.movers] == [
        "door",
        "chair_swivel",
        "chair_swivel",
        "person",
        "robot",
    ]
    assert scene.goals == {"0": (1.5, 4.0), "1": (6.0, 1.0)}
    assert scene.initial["chair0"][:2] == (2.0, 2.8)
    assert scene.options["n_people"] == 1
    assert list(problems(scene)) == []
    assert {
        "stands: 2 (1 desk, 1 door_frame)", "can move: 4 (2 chair_swivel, 1 door, 1 person)",
    } <= set(contents(scene))  # fmt: skip


def test_seats_that_come_with_a_table_are_optional(lab):
    assert "chair_swivel" in dict(scenes.build(lab(LAB)).places)
    assert scenes.build(lab(LAB), seats=False).places == ()


@pytest.mark.parametrize(
    ("was", "is_", "says"),
    [
        (
            "goals = [[1.5, 4], [6, 1]]",
            "goals = [[1.5, 4], [11, 1]]",
            "goal:1' at .* is in no room",
        ),
        ("goals = [[1.5, 4], [6, 1]]", "goals = [[4.5, 2.6]]", "goal:0' .* from a hinge"),
        (
            "[0, 5], [0, 0]]",
            "[0, 5], [0, 1.2]]",
            r"gap to nowhere: 1\.[012] m wide, at \(0\.0., 0\.[56]\d\), beside "
            r".*lab\.toml: walls\[0\] from \(0, 0\) to \(8, 0\) and .*walls\[0\] from \(0, 5\)",
        ),
        (
            "[[4, 2.98], [4, 5]]",
            "[[4, 2], [4, 5]]",
            r"1[678] m2 of floor about \([5-7]\..*, with goals 1, .*: .*lab\.toml: "
            r"walls\[[12]\] from \(4, .*shuts it off",
        ),
        (
            "[[4, 2.98], [4, 5]]",
            "[[4, 2.5], [4, 5]]",
            r"with goals 1, .* 0\.[34]\d m wide at \([34].*, 2\..*'door_frame0'.* needs 0\.57 m",
        ),
        ("[[4, 2.98], [4, 5]]", "[[4, 2.3], [4, 5]]", r"0\.[12]\d m wide at .* needs 0\.57 m"),
    ],
)
def test_check_names_what_is_wrong(lab, was, is_, says):
    name = lab(LAB.replace(was, is_))
    found = list(problems(scenes.build(name), which=name))
    assert any(re.search(says, line) for line in found), found


def test_check_names_the_geom_or_furniture_that_shuts_off_a_room(tmp_path):
    plan = tmp_path / "shed.xml"
    lines = [
        '<geom name="wall:mid" class="wall" pos="0 0 0.55" size="0.1 {} 0.55"/>',
        *(f'<site name="rack_a:a:{k}" pos="0 {y} 0" euler="0 0 1.5708"/>' for k, y in enumerate(
            (-1.2, 1.2))),
    ]  # fmt: skip
    walls = "".join(
        f'<geom name="wall:{k}" class="wall" pos="{x} {y} 0.55" size="{a} {b} 0.55"/>'
        for k, (x, y, a, b) in enumerate(
            [(0, 2.1, 3.2, 0.1), (0, -2.1, 3.2, 0.1), (3.1, 0, 0.1, 2), (-3.1, 0, 0.1, 2)]
        )
    )
    marks = (
        '<site name="room:a" type="box" size="3 2 0.01"/><site name="start:robot" pos="-2 0 0"/>'
    )
    for middle, says in ((lines[:1], r"shed\.xml: geom 'wall:mid'"), (lines[1:], "'rack_a[01]'")):
        text = "".join(middle).format(2)
        plan.write_text(f"<mujoco><worldbody>{walls}{text}{marks}</worldbody></mujoco>")
        found = [line for line in problems(scenes.build(str(plan))) if "of floor about" in line]
        assert re.search(rf"{says}.* shuts it off|beside .*{says}", found[0]), found


def test_a_seat_of_an_unknown_kind_is_named_before_anything_runs(tmp_path):
    plan = tmp_path / "shed.xml"
    plan.write_text(
        '<mujoco><worldbody><site name="room:a" type="box" size="2 2 0.01"/>'
        '<site name="start:robot"/><site name="seat:chair:0"/></worldbody></mujoco>'
    )
    with pytest.raises(InvalidValueError, match=r"shed\.xml.*'seat:chair:0'.*chair_swivel"):
        scenes.build(str(plan))


SHED = """<mujoco><worldbody>
  <geom name="wall:north" class="wall" pos="0 2.1 0.55" size="3.2 0.1 0.55"/>
  <site name="room:shed" type="box" size="3 2 0.01"/> <site name="start:robot" pos="-2 0 0"/>
  <site name="put:chair_swivel" pos="1 1 0"/> <site name="put:desk" pos="0 1.5 0"/>
</worldbody></mujoco>"""


def test_a_mark_puts_furniture_by_kind_and_place(tmp_path):
    plan = tmp_path / "shed.xml"
    plan.write_text(SHED)
    for scene in (scenes.build(str(plan), 1), scenes.filled(plan, 1)):
        assert [(m.name, m.kind) for m in scene.movers] == [
            ("chair0", "chair_swivel"), ("robot", "robot"),
        ]  # fmt: skip
        assert scene.initial["chair0"][:2] == (1.0, 1.0)
        assert scene.spec.body("desk0/base") is not None
    plan.write_text(SHED.replace("chair_swivel", "chair"))
    with pytest.raises(InvalidValueError, match="'put:chair' has the unknown kind 'chair'"):
        scenes.build(str(plan), 1)


BOX = "walls = [[[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]]]\nstart = [1, 1, 0]\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (BOX + 'put = [["dsek", 4, 3, 0]]', r"lab\.toml: put\[0\] must be one of .*, got 'dsek'"),
        (BOX.replace("start", "begin"), r"lab\.toml: unknown key 'begin'"),
        (BOX.replace("8, 5", "8, nan"), r"walls\[0\]\[2\]\[1\] must be a number from"),
        (BOX + 'hinges = [[4, 2, 90, "up"]]', r"hinges\[0\]\[3\] must be one of left, right"),
        (BOX + 'plan = "x.xml"', "plan or walls must be one of the two"),
        (BOX + f"goals = [[1{'0' * 400}, 1]]", r"goals\[0\]\[0\] must be a number"),
        (BOX + f"wall_m = {'9' * 5000}", "no TOML: .*limit"),
        (BOX + f"wall_m = {'[' * 5000}", "no TOML"),
        (BOX + "rooms = [[0, 0, 9000, 9000]]", "at most 60000 m2|is in no room"),
        (BOX.replace("8, 0", "9000, 0").replace("8, 5", "9000, 9000"), "at most 60000 m2"),
        (f"walls = [[{'[0, 0], [8, 0], ' * 6000}[8, 5]]]\n", "walls.* of 2 to 5000 values"),
        (f"walls = [{('[' + '[0, 0], [8, 5], ' * 2000 + '], ') * 4}]\n", "at most 10000 boxes"),
        (BOX + "put = [" + '["desk", 4, 3, 0], ' * 31 + "]", "at most 30 pieces of furniture"),
        (BOX + "put = [" + '["bin", 4, 3, 0], ' * 2 + "]", r"'bin1' at \(4, 3\) stands in 'bin0'"),
        ("walls = []", "walls must be one polyline or more"),
        ('plan = "/etc/shed.xml"', "'/etc/shed.xml', expected one beside it"),
        ('plan = "../shed.xml"', "'../shed.xml', expected one beside it"),
        ('plan = "out.xml"', "'out.xml', expected one beside it"),
        ('plan = "pipe.xml"', r"pipe\.xml: cannot be read: not a file"),
        ('plan = "loop.xml"', "beside it|cannot be read"),
    ],
)  # fmt: skip
def test_values_and_paths_that_cannot_be_are_told_in_one_line(
    lab, tmp_path, text, says, monkeypatch
):
    monkeypatch.setattr("scenes.assembly.MOST_PARTS", 30)
    inside = tmp_path / "in"
    inside.mkdir()
    (tmp_path / "shed.xml").write_text(SHED)
    (inside / "out.xml").symlink_to(tmp_path / "shed.xml")
    (inside / "loop.xml").symlink_to("loop.xml")
    os.mkfifo(inside / "pipe.xml")
    file = inside / "lab.toml"
    file.write_text(text)
    with pytest.raises(MobiliaError, match=says) as told:
        scenes.build(str(file))
    assert "in/" in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("name", ["/etc/robot.toml", "../robot.toml"])
def test_a_robot_from_elsewhere_is_refused(lab, name):
    with pytest.raises(MobiliaError, match="expected one beside it"):
        Simulation(lab(BOX + f'robot = "{name}"'))


ENTER = "[[event]]\nat_s = 1\nenter = 20\nby = [{}, 3]\n"


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (ENTER.format(3) * 30, "events: 600 people enter, expected at most 400"),
        (ENTER.format(999), "event at 1 s: nobody finds room to enter"),
        ("[[event]]\nat_s = nan\nenter = 1\nby = [3, 3]\n", "event 1.at_s must be a number"),
        ('robot = "roomba"\n', "no robot is called 'roomba'"),
    ],
)
def test_what_is_wrong_in_its_events_and_robot_is_told_with_the_file(lab, more, says):
    with pytest.raises(MobiliaError, match=rf"lab\.toml: {says}"):
        Simulation(lab(BOX + more))


def test_things_beyond_the_most_stand(lab, monkeypatch):
    monkeypatch.setattr("scenes.from_file.MOST_MOVING", 1)
    things = "".join(
        f'{{ kind = "bin", at = [{x}, 3, 0], boxes = [[{x}, 3, 0.2, 0.2, 0]] }}, ' for x in (3, 5)
    )
    scene = scenes.build(lab(BOX + f"things = [{things}]"))
    assert [mover.kind for mover in scene.movers] == ["bin", "robot"]
    assert scene.spec.geom("wall:thing0") is not None
