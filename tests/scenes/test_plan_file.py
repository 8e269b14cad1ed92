# SPDX-License-Identifier: Apache-2.0
"""Plans from elsewhere: what one may hold passes unchanged, all else is told with its line."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import scenes
from scenes import plan_file
from scenes.assembly import HERE, ours, parsed
from slam.errors import InvalidValueError, MobiliaError

SHED = """<mujoco model="shed">
<worldbody>
  <geom name="floor:shed" class="floor" size="3 2 0.1" material="floor_concrete"/>
  <geom name="wall:north" class="wall" pos="0 2.1 0.55" size="3.2 0.1 0.55"/>
  <geom name="wall:south" class="wall" pos="0 -2.1 0.55" size="3.2 0.1 0.55"/>
  <site name="room:shed" type="box" size="3 2 0.01"/> <site name="start:robot" pos="-2 0 0"/>
</worldbody>
</mujoco>
"""
GOALS = (
    '<site name="room:hall" type="box" size="120 120 0.1"/>'
    + "".join(f'<site name="goal:{k}"/>' for k in range(40))
    + "</worldbody>"
)
LAUGHS = '<!DOCTYPE m [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>\n'
SIZED = ("geom_pos", "geom_size", "geom_quat", "geom_contype", "body_mass", "jnt_axis", "cam_pos")


@pytest.fixture
def plan(tmp_path: Path):
    """Writes a plan; gives its name."""

    def written(text: str, name: str = "shed.xml") -> str:
        (tmp_path / name).write_text(text, encoding="utf-8")
        return str(tmp_path / name)

    return written


def alike(one: mujoco.MjModel, other: mujoco.MjModel) -> None:
    assert one.ngeom == other.ngeom
    for name in SIZED:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("name", [n for n in ours("plans") if n != "blank"])
def test_a_copy_of_a_plan_of_ours_is_the_same_scene(name: str, plan):
    copy = plan((HERE / "plans" / f"{name}.xml").read_text())
    alike(scenes.filled(copy, 1).compile(), scenes.filled(name, 1).compile())


@pytest.mark.parametrize("name", ours("parts"))
def test_a_copy_of_a_part_of_ours_is_the_same_part(name: str, plan):
    copy = plan((HERE / "parts" / f"{name}.xml").read_text())
    alike(parsed("parts", copy).compile(), parsed("parts", name).compile())


def test_what_a_plan_may_hold_besides(plan):
    more = """<geom name="a" type="capsule" fromto="1 1 0 1 1 1" size="0.1" material="marble_red"/>
      <body name="b" pos="0 1 0"><geom type="cylinder" size="0.1 0.5" euler="0 0 0.3"/></body>
      <camera name="top" pos="0 0 9" fovy="40"/> <light pos="0 0 3" dir="0 0 -1"/>"""
    text = SHED.replace("</worldbody>", more + "</worldbody>").replace(
        "<worldbody>", '<asset><material name="marble_red" rgba="1 0 0 1"/></asset><worldbody>'
    )
    assert scenes.build(plan(text)).compile().geom("a").type[0] == mujoco.mjtGeom.mjGEOM_CAPSULE


WRONG = {
    "replicate": ('<replicate count="1000000000"><geom size="1"/></replicate>', "replicate: not"),
    "mesh": ('<geom type="mesh" mesh="m"/>', "geom: .*mesh"),
    "attribute": ('<geom name="x" size="1" gap="1"/>', "geom 'x': .*'gap'; known: .*contype"),
    "far": ('<geom name="wall:x" class="wall" pos="1e19 0 0" size="1 1 1"/>', "geom 'wall:x': pos"),
    "nan": ('<geom name="x" pos="nan 0 0" size="1"/>', r"geom 'x': pos\[0\] must be a number from"),
    "tiny": ('<geom name="x" size="1e-200"/>', "size must be 0 or at least 1e-06 m"),
    "mark": ('<site name="goal:z" pos="nan nan 0"/>', r"site 'goal:z': pos\[0\]"),
    "long": (f'<site name="goal:{"z" * 200}"/>', "name must be a word of at most|letters"),
    "deep": ("<body>" * 30 + "</body>" * 30, "body: too deep"),
    "include": ('<include file="/dev/zero"/>', "include: not known in worldbody"),
    "site in a body": ('<body><site name="goal:a"/></body>', "site 'goal:a': not known in body"),
}
WRONG_HEAD = {
    "include": (
        '<include file="other.xml"/>',
        "include: file must be one of common.xml, world.xml",
    ),
    "option": ('<option timestep="1e-9"/>', "option: not known in mujoco"),
    "size": ('<size memory="100G"/>', "size: not known in mujoco, expected include"),
    "compiler": ('<compiler meshdir="/"/>', "compiler: .*'meshdir'"),
    "mesh": ('<asset><mesh name="m" file="/etc/passwd"/></asset>', "mesh 'm': not known in asset"),
}
CASES = {
    **{f"world: {k}": (SHED.replace("</worldbody>", f"{a}\n</worldbody>"), 7, b)
       for k, (a, b) in WRONG.items()},
    **{f"head: {k}": (SHED.replace("<worldbody>", f"{a}\n<worldbody>"), 2, b)
       for k, (a, b) in WRONG_HEAD.items()},
    "entities": (LAUGHS + SHED, 1, "it has a DOCTYPE"),
    "the whole": ("<robot/>", 1, "robot: not known as the whole, expected mujoco"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_a_plan_may_not_hold_is_told_with_its_line(case: str, plan):
    text, line, says = CASES[case]
    with pytest.raises(InvalidValueError, match=rf"shed\.xml:{line}: .*({says})") as told:
        scenes.build(plan(text))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("was", "is_", "says"),
    [
        ('size="3.2 0.1 0.55"', 'size="3.2 0.1"', "size 2 must be positive.*wall:north.*line 4"),
        ("wall:south", "wall:north", "repeated name 'wall:north'.*line 5"),
        ('class="floor"', 'class="wool"', "'wool'.*line 3"),
        ('size="3 2 0.01"', 'size="3 0 0.01"', "two half sizes > 0 m"),
        ('size="3 2 0.01"', 'size="300 200 0.01"', "spans 600 x 400 m, expected at most 60000 m2"),
        ("</mujoco>", "", "no MJCF: no element found"),
        ("</worldbody>", GOALS, "has 40 goals on 240 x 240 m, expected at most 26"),
        ("<site", '<site name="bounds:a" type="box" size="1 1 1"/><site', "is in no bounds"),
    ],
)
def test_what_cannot_be_built_is_told_in_one_line(was: str, is_: str, says: str, plan):
    name = plan(SHED.replace(was, is_, 1))
    with pytest.raises(InvalidValueError, match=rf"shed\.xml.*({says})") as told:
        scenes.build(name)
    assert "\n" not in str(told.value)


def test_too_many_of_anything_are_told_before_they_are_built(plan, monkeypatch):
    for one, most in (("geom", plan_file.MOST_BOXES), ("site", plan_file.MOST_MARKS),
                      ("camera", plan_file.MOST)):  # fmt: skip
        many = "\n".join(f'<{one} name="x{k}"/>' for k in range(most + 1))
        with pytest.raises(InvalidValueError, match=f"expected at most {most} of these"):
            scenes.build(plan(SHED.replace("</worldbody>", many + "</worldbody>")))
    long = "\n".join(f'<geom size="9 9 9" name="x{k}" type="box"/>' for k in range(1200))
    with pytest.raises(InvalidValueError, match="m of walls and geoms, expected at most 20000 m"):
        scenes.build(plan(SHED.replace("</worldbody>", long + "</worldbody>")))
    monkeypatch.setattr("scenes.assembly.MOST_PARTS", 30)
    desks = "".join(f'<site name="desk:{k}"/>' for k in range(31))
    with pytest.raises(InvalidValueError, match="at most 30 pieces of furniture"):
        scenes.build(plan(SHED.replace("</worldbody>", desks + "</worldbody>")))
    with pytest.raises(MobiliaError, match="at most 4194304 are allowed"):
        scenes.build(plan(SHED + " " * plan_file.MAX_BYTES))


def test_what_mujoco_refuses_of_the_whole_is_one_line(plan):
    name = plan(SHED.replace("<worldbody>", '<worldbody><body name="robot/base"/>'))
    with pytest.raises(InvalidValueError, match=r"'shed': no model .*repeated name 'robot/base'"):
        scenes.build(name).compile()


@pytest.mark.parametrize(
    ("cameras", "name"),
    [('<camera name="follow"/>', "follow"), ('<camera name="a/top"/><camera name="top"/>', "top")],
)
def test_two_cameras_of_one_name_are_one_line(plan, cameras, name):
    with pytest.raises(InvalidValueError, match=rf"shed\.xml: camera '{name}': there are two"):
        scenes.build(plan(SHED.replace("<worldbody>", f"<worldbody>{cameras}")), 1)


def test_a_link_that_is_typed_is_followed(plan, tmp_path: Path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.xml").symlink_to(plan(SHED))
    assert scenes.build(str(tmp_path / "in" / "link.xml")).name == "link"
