# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes, built or found."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from slam.ros.link import MIDDLEWARES
from tests.slam.ros.idl import idl_of

HERE = Path(__file__).parent
KINDS = ("sensor_msgs/msg/LaserScan", "geometry_msgs/msg/TwistStamped", "tf2_msgs/msg/TFMessage")


@pytest.fixture(scope="session")
def node(tmp_path_factory) -> Path:
    """The C++ node, built."""
    pytest.importorskip("cyclonedds", reason="needs the extra ros2")
    if not shutil.which("fastddsgen") or not shutil.which("g++"):
        pytest.skip("needs fastddsgen, libfastrtps-dev and g++ (Debian has them)")
    folder = tmp_path_factory.mktemp("node")
    (folder / "ros.idl").write_text(idl_of(KINDS))
    words = ["g++", "-std=c++17", "-O0", "-w", "-I.", str(HERE / "node.cpp"), "ros.cxx"]
    libraries = ["rosPubSubTypes.cxx", "-lfastrtps", "-lfastcdr", "-o", "node"]
    for command in (["fastddsgen", "-replace", "ros.idl"], [*words, *libraries]):
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=300)
    return folder / "node"


@pytest.fixture(params=MIDDLEWARES)
def client(request) -> tuple[str, list[object]]:
    """A middleware and the words that start a client of another make on it."""
    if request.param == "dds":
        return "dds", [request.getfixturevalue("node")]
    pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
    return "zenoh", [sys.executable, HERE / "zenoh_client.py"]
