# SPDX-License-Identifier: Apache-2.0
"""IDL of the message types that we speak, as ROS 2 has it: what other makes generate types from.

python tests/slam/ros/idl.py sensor_msgs/msg/LaserScan > ros.idl
"""

import sys
from collections.abc import Iterable
from typing import Any

from rosbags.interfaces import Nodetype

from slam.ros.template import STORE

BASES = {
    "bool": "boolean", "byte": "octet", "octet": "octet", "char": "uint8", "string": "string",
    "float32": "float", "float64": "double", **{name: name for name in (
        "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    )},
}  # fmt: skip


def idl_of(kinds: Iterable[str]) -> str:
    """All of them and what they are made of, each once, parts first."""
    made: dict[str, str] = {}
    for kind in kinds:
        _add(kind, made)
    return "\n".join(made.values())


def _add(kind: str, made: dict[str, str]) -> None:
    if kind in made:
        return
    rows = []
    for name, how in STORE.fielddefs[kind][1]:
        rows.append(f"    {_declared(how, name, made)};")
    package, _, own = kind.rpartition("/")
    modules = [*package.split("/"), "dds_"]
    body = "\n".join([f"  struct {own}_ {{", *rows, "  };"])
    made[kind] = "".join(f"module {m} {{ " for m in modules) + f"\n{body}\n" + "};" * len(modules)


def _declared(how: Any, name: str, made: dict[str, str]) -> str:
    sort, what = how
    if sort in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        inner = _type(what[0], made)
        return (
            f"{inner} {name}[{what[1]}]" if sort == Nodetype.ARRAY else f"sequence<{inner}> {name}"
        )
    return f"{_type(how, made)} {name}"


def _type(how: Any, made: dict[str, str]) -> str:
    sort, what = how
    if sort == Nodetype.BASE:
        return BASES[what[0]]
    _add(what, made)
    package, _, own = what.rpartition("/")
    return f"{package.replace('/', '::')}::dds_::{own}_"


if __name__ == "__main__":
    print(idl_of(sys.argv[1:]))
