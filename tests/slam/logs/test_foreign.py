# SPDX-License-Identifier: Apache-2.0
"""What is packed, or of another make, is told as what it is."""

import bz2
import gzip
import tarfile

import pytest
from mcap.writer import Writer

import tests.slam.logs.foreign_bags as bags
from slam.errors import LogFormatError
from slam.logs import open_log


@pytest.fixture
def bag(tmp_path):
    """The bytes of a bag of ROS 1."""
    make = bags.Maker(ros1=True)
    return bags.write_ros1(tmp_path / "a.bag", [make.scan(bags.START_NS, [1.0])]).read_bytes()


@pytest.mark.parametrize(
    ("name", "pack", "says"),
    [
        ("b.bag.gz", gzip.compress, r"is packed \(gzip\): unpack it \(gunzip b.bag.gz\)"),
        ("b.bag.bz2", bz2.compress, r"is packed \(bzip2\): unpack it \(bunzip2"),
        ("b.mcap", bytes, r"is a bag of ROS 1 \(.bag\) by its first bytes: name it so"),
        ("noname", bytes, r"is a bag of ROS 1 \(.bag\) by its first bytes: name it so"),
    ],
)
def test_a_packed_bag_says_how_to_unpack_it(tmp_path, bag, name, pack, says):
    (tmp_path / name).write_bytes(pack(bag))
    with pytest.raises(LogFormatError, match=says):
        open_log(tmp_path / name)


def test_an_archive_of_a_folder_is_named(tmp_path, bag):
    for name, mode, says in (("a.tar", "w", "tar xf a.tar"), ("a.tgz", "w:gz", "gunzip a.tgz")):
        with tarfile.open(tmp_path / name, mode) as archive:
            archive.add(tmp_path / "a.bag", "a.bag")
        with pytest.raises(LogFormatError, match=says):
            open_log(tmp_path / name)


@pytest.mark.parametrize(
    ("profile", "encoding", "schema", "says"),
    [
        ("ros1", "ros1", "ros1msg", "is an MCAP with messages in ros1; messages of ROS 2 "),
        ("", "json", "jsonschema", "is an MCAP with messages in json; messages of ROS 2 "),
        ("ros2", "protobuf", "protobuf", "is an MCAP with messages in protobuf; "),
        ("other", "cdr", "ros2msg", "is an MCAP with profile other; messages of ROS 2 "),
    ],
)
def test_an_mcap_of_other_messages_says_which(tmp_path, profile, encoding, schema, says):
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile, "test")
        kind = writer.register_schema("sensor_msgs/msg/LaserScan", schema, b"{}")
        channel = writer.register_channel("/scan", encoding, kind)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(LogFormatError, match=says):
        open_log(tmp_path / "a.mcap")
