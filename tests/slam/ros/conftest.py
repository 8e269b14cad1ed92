# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes, built or found, and one network for all of them."""

import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import gettempdir

import pytest

from slam.ros.link import MIDDLEWARES
from tests.slam.ros.idl import idl_of

HERE = Path(__file__).parent
KINDS = ("sensor_msgs/msg/LaserScan", "geometry_msgs/msg/TwistStamped", "tf2_msgs/msg/TFMessage")


@pytest.fixture(scope="session")
def node(tmp_path_factory) -> Path:
    """The C++ node, built once for all processes of a run."""
    pytest.importorskip("cyclonedds", reason="needs the extra ros2")
    if not shutil.which("fastddsgen") or not shutil.which("g++"):
        pytest.skip("needs fastddsgen, libfastrtps-dev and g++ (Debian has them)")
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "node"
    folder.mkdir(exist_ok=True)
    with (folder / "ros.idl").open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if file.tell():
            return folder / "node"
        file.write(idl_of(KINDS))
        file.flush()
        words = ["g++", "-std=c++17", "-O0", "-w", "-I.", str(HERE / "node.cpp"), "ros.cxx"]
        libraries = ["rosPubSubTypes.cxx", "-lfastrtps", "-lfastcdr", "-o", "node"]
        for command in (["fastddsgen", "-replace", "ros.idl"], [*words, *libraries]):
            subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=300)
    return folder / "node"


@contextmanager
def network(how: int) -> Iterator[None]:
    """Until its end, no test adds an interface (LOCK_SH), or none has a client (LOCK_EX).

    A participant states the addresses of all interfaces that are there when it starts: one that
    goes again is where its scans are sent.
    """
    with (Path(gettempdir()) / f"mobilia-network-{os.getuid()}").open("a") as held:
        fcntl.flock(held, how)
        yield


@pytest.fixture(params=MIDDLEWARES)
def client(request) -> Iterator[tuple[str, list[object]]]:
    """A middleware and the words that start a client of another make on it."""
    if request.param == "dds":
        words = [request.getfixturevalue("node")]
    else:
        pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
        words = [sys.executable, HERE / "zenoh_client.py"]
    with network(fcntl.LOCK_EX if "cable" in request.fixturenames else fcntl.LOCK_SH):
        yield request.param, words
