# SPDX-License-Identifier: Apache-2.0
"""A plan of a map as files to read and edit: MJCF, and the recipe that fills it."""

import json
import math
from pathlib import Path
from xml.sax.saxutils import quoteattr

from scenes.from_map.plan import MapPlan
from scenes.plan import WALL_HEIGHT
from slam.files import write_text

UP = 0.5 * WALL_HEIGHT
DOOR_M = 0.94  # the opening that a door and its frame stand in, parts/door_frame.xml


def mjcf(plan: MapPlan, name: str) -> str:
    """Walls, rooms, spots to visit and the start."""
    x0, y0, x1, y1 = plan.bounds
    middle, half = (0.5 * (x0 + x1), 0.5 * (y0 + y1)), (0.5 * (x1 - x0), 0.5 * (y1 - y0))
    lines = [
        "<!-- A plan of a map, in m and rad; sizes are half. Marks: docs/scenes.md. -->",
        f"<mujoco model={quoteattr(name)}>",
        f'  <statistic center="{_n(*middle)} 0" extent="{_n(max(half) * 2)}" meansize="0.3"/>',
        "  <worldbody>",
        f'    <geom name="ground" class="floor" pos="{_n(*middle)} -0.03"'
        f' size="{_n(half[0] + 40, half[1] + 40)} 0.1" material="ground"/>',
        f'    <geom name="floor:all" class="floor" pos="{_n(*middle)} 0" size="{_n(*half)} 0.1"'
        ' material="floor_concrete"/>',
    ]
    walls = [(str(k), box) for k, box in enumerate(plan.walls.tolist())]
    for name, (x, y, a, b, yaw) in walls + [
        (f"end{k}", box) for k, box in enumerate(plan.ends.tolist())
    ]:
        lines.append(
            f'    <geom name="wall:{name}" class="wall" pos="{_n(x, y, UP)}" size="{_n(a, b, UP)}"'
            f' euler="0 0 {_n(math.remainder(yaw, math.pi))}"/>'
        )
    lines.append(
        f'    <site name="bounds:all" type="box" pos="{_n(*middle)} 0" size="{_n(*half)} 0.01"/>'
    )
    for room, rects in plan.rooms.items():
        for k, (a, b, c, d) in enumerate(rects):
            pos, size = _n(0.5 * (a + c), 0.5 * (b + d)), _n(0.5 * (c - a), 0.5 * (d - b))
            lines.append(
                f'    <site name="room:{room}{f".{k}" if k else ""}" type="box" pos="{pos} 0"'
                f' size="{size} 0.01"/>'
            )
    x, y, yaw = plan.start
    lines.append(f'    <site name="start:robot" pos="{_n(x, y)} 0" euler="0 0 {_n(yaw)}"/>')
    lines += [
        f'    <site name="goal:{k}" pos="{_n(x, y)} 0"/>' for k, (x, y) in enumerate(plan.goals)
    ]
    return "\n".join([*lines, "  </worldbody>", "</mujoco>", ""])


def recipe(
    plan: MapPlan, plan_file: str, *, furniture: str, doors: str, made_of: str, robot: str = ""
) -> str:
    """The TOML file by which the scene is named: each thing and each door is a line."""
    one_line = "".join(c if c.isprintable() else "?" for c in made_of)
    lines = [
        f"# Made of {one_line}. Lengths in m, angles in degrees. A # before a line leaves it out.",
        f"plan = {json.dumps(plan_file, ensure_ascii=False)}",  # a string of TOML, too
        "",
        "# What the scene has unless it is asked for otherwise.",
        f'furniture = "{furniture}"  # of things: "move" can be pushed, "keep" stands, "drop"',
        f'doors = "{doors}"  # "none", "open", "ajar", "closed", "mixed"',
        "n_chairs = 0",
        "n_people = 0",
        "",
        "things = [  # what may move; in its place boxes that stand, [x, y, length, width, turned]",
    ]
    for thing in plan.things:
        x, y, yaw = thing.at
        boxes = ", ".join(
            f"[{_n(px, py, 2 * a, 2 * b, sep=', ')}, {_degrees(turned)}]"
            for px, py, a, b, turned in thing.parts
        )
        lines.append(
            f'  {{ kind = "{thing.kind}", at = [{_n(x, y, sep=", ")}, {_degrees(yaw)}],'
            f" boxes = [{boxes}] }},"
        )
    lines += [
        "]",
        "",
        "hinges = [  # of doors: x, y, direction of the shut leaf, the side it opens to",
    ]
    for gap in plan.gaps:
        x, y, yaw = gap.at
        c, s = math.cos(yaw), math.sin(yaw)
        half = 0.5 * DOOR_M
        lines.append(
            f'  [{_n(x - half * c, y - half * s, sep=", ")}, {_degrees(yaw)}, "left"],'
            f"  # a gap of {gap.wide_m:.2f} m"
        )
    return "\n".join([*lines, "]", *([robot] if robot else []), ""])


def write(
    plan: MapPlan,
    stem: Path,
    *,
    furniture: str = "move",
    doors: str = "open",
    made_of: str = "a map",
    robot: str = "",
) -> Path:
    """``<stem>.xml`` and ``<stem>.toml``; returns the latter, the name of the scene.

    furniture  what becomes of small things: "move", "keep" or "drop"
    doors      how they rest; "none" leaves the gaps open
    robot      lines of TOML that say which one drives there, if not the scenes' own
    """
    plan_file = stem.with_name(stem.name + ".xml")
    write_text(plan_file, mjcf(plan, stem.name))
    file = stem.with_name(stem.name + ".toml")
    write_text(
        file,
        recipe(
            plan, plan_file.name, furniture=furniture, doors=doors, made_of=made_of, robot=robot
        ),
    )
    return file


def _n(*values: float, sep: str = " ") -> str:
    return sep.join(f"{value + 0.0:.3f}".rstrip("0").rstrip(".") for value in values)


def _degrees(yaw: float) -> str:
    return f"{math.degrees(math.remainder(yaw, math.tau)):.1f}"
