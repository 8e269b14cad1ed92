# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, message by message in the order in which they were recorded.

The rosbags library reads the index at a file's end, and sorts by time. What a killed recorder
leaves has no such end, and a clock that steps back does not sort: here, a file is read from its
beginning, up to the first record that is not whole.
"""

import io
import os
import re
import shutil
import sqlite3
import struct
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO
from urllib.parse import quote

from rosbags.rosbag1 import reader as ros1
from rosbags.rosbag2 import storage_mcap
from rosbags.typesys.msg import normalize_msgtype
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from slam.bounded import beside, check_file, text_of
from slam.errors import LogFormatError
from slam.logs import unpacking
from slam.logs.text import IMPOSSIBLE

Record = tuple[str, str, int, bytes]  # topic, type, log time ns, message
Wanted = Collection[str] | None  # topics; None: all
METADATA = "metadata.yaml"
MAX_METADATA_BYTES = 1 << 22  # of 2000 topics with their QoS; half a minute to read
CURES = {".mcap": "mcap recover", ".bag": "rosbag reindex", ".db3": "sqlite3 FILE .recover"}
_MCAP, _SQLITE, _ROS1 = b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n"
_MCAP_FOOTER = b"\x02\x14" + bytes(7)
_MCAP_END_BYTES = 37  # footer and magic
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 3, 4, 5, 6  # records of MCAP that are read
IN_CHUNK = "a chunk in a chunk"  # each may unpack to the most that one may
_ENDS = (2, 15)  # footer, end of the data
_SIDECARS = ("-wal", "-journal")  # what SQLite has not yet, or half, put into the file


class CutShortError(ValueError):
    """A record is not whole."""


def suffix_of(path: Path) -> str:
    """``.mcap``, ``.db3`` or ``.bag``, also of what a recorder had not finished or packed."""
    return Path(path.name.removesuffix(".active").removesuffix(".zstd")).suffix


def is_folder_of_one(path: Path) -> bool:
    """Whether its recordings are those of one recorder, killed before it wrote metadata.yaml."""
    found = _stored(path) if path.is_dir() else []
    return bool(found) and all(file.name.startswith(path.name) for file in found)


def files_of(path: Path) -> tuple[list[Path], dict[str, int], list[str]]:
    """The files of a bag; messages by topic, and files, of which metadata.yaml alone knows.

    The only .mcap of a folder says all itself, and sooner than the YAML.
    """
    if not path.is_dir():
        return [path], {}, []
    found = _stored(path)
    if len(found) == 1 and found[0].suffix == ".mcap":
        return found, {}, []
    listed, counts = _metadata(path / METADATA)
    by_name = {file.name: file for file in found}
    by_name |= {f"{file.name}.zstd": file for file in found if file.suffix != ".zstd"}
    files = list(dict.fromkeys(by_name[name] for name in listed if name in by_name))
    return files or found, counts, [name for name in listed if name not in by_name]


def _stored(folder: Path) -> list[Path]:
    """The recordings in it, ``a_2`` before ``a_10``."""
    found = [file for file in folder.iterdir() if suffix_of(file) in (".mcap", ".db3")]
    for file in found:
        if file.is_symlink() and folder.resolve() not in file.resolve().parents:
            raise LogFormatError(file, "a link out of its folder: name the recording itself")
    return sorted(found, key=lambda file: [
        (int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", file.name)
    ])  # fmt: skip


def _metadata(path: Path) -> tuple[list[str], dict[str, int]]:
    """Names of files, and messages by topic; nothing of what is damaged: the files say it too."""
    try:
        # never built: keys that merge others would make a few lines more than any memory
        root = YAML(typ="base", pure=True).compose(text_of(path, MAX_METADATA_BYTES))
        said = _fields(_fields(root)["rosbag2_bagfile_information"])
        names = [PurePath(name.value).name for name in said["relative_file_paths"].value]
        topics = [_fields(topic) for topic in said["topics_with_message_count"].value]
        counts = {
            str(_fields(topic["topic_metadata"])["name"].value): int(topic["message_count"].value)
            for topic in topics
        }
    except (YAMLError, AssertionError, RecursionError, LogFormatError, *IMPOSSIBLE):
        return [], {}
    return names, counts


def _fields(node: Any) -> dict[str, Any]:
    """The nodes of a mapping of YAML, by their keys."""
    return {key.value: value for key, value in node.value}


def settled(path: Path, stack: ExitStack) -> tuple[Path, str]:
    """The file as it can be read, and what is wrong with it: a copy until ``stack`` ends, of one
    that is packed or half written.

    Nothing is written beside a recording.
    """
    names = [path.name + s for s in _SIDECARS if path.suffix == ".db3"]
    also = [beside(path, name) for name in names if path.with_name(name).exists()]
    also = [file for file in also if file.stat().st_size]
    packed, torn = path.suffix == ".zstd", _torn_bytes(path)
    if not (packed or also or torn):
        return path, ""
    folder = Path(stack.enter_context(TemporaryDirectory()))
    copy = folder / path.name.removesuffix(".zstd")
    if packed:
        with path.open("rb") as file, copy.open("wb") as out:
            shutil.copyfileobj(unpacking.unpacked(file), out)
        return copy, ""
    for part in (path, *also):
        check_file(part)
        shutil.copyfile(part, folder / part.name)
    if not also:
        os.truncate(copy, path.stat().st_size - torn)
        return copy, ""
    try:
        with closing(sqlite3.connect(copy)) as database:
            database.execute("SELECT count(*) FROM sqlite_master").fetchone()  # undoes a journal
            pages = database.execute("PRAGMA wal_checkpoint").fetchone()[1]
    except sqlite3.DatabaseError:
        pages = 0
    return copy, "" if pages else f"{also[0].name} has nothing that SQLite can read"


def _torn_bytes(path: Path) -> int:
    """Of half a page at the end of a file of SQLite: it would be read as if zeros followed."""
    with path.open("rb") as file:
        head = file.read(18)
    if not head.startswith(_SQLITE):
        return 0
    page = int.from_bytes(head[16:], "big")
    return path.stat().st_size % max(65536 if page == 1 else page, 512)


def can_be_cut(path: Path) -> bool:
    """Whether that is a recording, of a kind that is read here, whose end may be missing."""
    with path.open("rb") as file:
        head = file.read(len(_SQLITE))
        if head.startswith(_MCAP):
            file.seek(max(-_MCAP_END_BYTES, -os.fstat(file.fileno()).st_size), os.SEEK_END)
            tail = file.read()
            return not (tail.endswith(_MCAP) and tail.startswith(_MCAP_FOOTER))
        if head.startswith(_ROS1):
            file.seek(len(_ROS1))
            return not ros1.Header.read(file).get("encryptor")
        return head == _SQLITE


def check_tables(path: Path) -> None:
    """``ValueError`` for a file of SQLite that computes what it says: it may do so without end."""
    if suffix_of(path) != ".db3":
        return
    with closing(_opened(path)) as database, suppress(sqlite3.DatabaseError):  # the reader says it
        for kind, name, page in database.execute("SELECT type, name, rootpage FROM sqlite_master"):
            if kind not in ("table", "view"):
                continue
            columns = database.execute("SELECT hidden FROM pragma_table_xinfo(?)", [name])
            if kind == "view" or not page or any(hidden for (hidden,) in columns):
                raise ValueError(f"{name} is not a table of messages, but computed")


def _opened(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"file:{quote(str(path.resolve()))}?immutable=1", uri=True)


def records(path: Path, wanted: Wanted = None) -> Iterator[Record]:
    """The messages in the order of the file; ``CutShortError`` where a record is not whole."""
    walk: Callable[[Path, Wanted], Iterator[Record]] = {
        ".mcap": _mcap, ".db3": _sqlite, ".bag": _ros1
    }[suffix_of(path)]  # fmt: skip
    yield from walk(path, wanted)


def _mcap(path: Path, wanted: Wanted) -> Iterator[Record]:
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    with path.open("rb") as file:
        file.seek(len(_MCAP))
        for kind, data in _mcap_records(file, path.stat().st_size):
            if kind == _MESSAGE:
                channel, _, log_ns, _ = struct.unpack_from("<HIQQ", data)
                topic, name = channels[channel]
                if wanted is None or topic in wanted:
                    yield topic, name, log_ns, data[22:]
            elif kind == _SCHEMA:
                rest = io.BytesIO(data[2:])
                schemas[int.from_bytes(data[:2], "little")] = storage_mcap.read_string(rest)
            else:
                rest = io.BytesIO(data[4:])
                number, schema = struct.unpack_from("<HH", data)
                channels[number] = storage_mcap.read_string(rest), schemas.get(schema, "")


def _mcap_records(file: BinaryIO, end: int, depth: int = 0) -> Iterator[tuple[int, bytes]]:
    """Schemas, channels and messages, those in chunks too."""
    while head := file.read(9):
        if len(head) < 9:
            raise CutShortError("a record has no end")
        kind, size = struct.unpack("<BQ", head)
        if kind in _ENDS:
            return
        whole = size <= end - file.tell()
        if kind in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
            data = file.read(min(size, end))
            if kind == _CHUNK and depth:
                raise ValueError(IN_CHUNK)
            if kind == _CHUNK:
                inside = _mcap_chunk(data, whole)
                yield from _mcap_records(io.BytesIO(inside), len(inside), depth + 1)
            elif whole:
                yield kind, data
        elif whole:
            file.seek(size, os.SEEK_CUR)
        if not whole:
            raise CutShortError("a record has no end")


def _mcap_chunk(data: bytes, whole: bool) -> bytes:
    """What is in it; of one that is cut, what comes before."""
    _, _, size, crc = struct.unpack_from("<QQQI", data)
    rest = io.BytesIO(data[28:])
    compression = storage_mcap.read_string(rest)
    packed_size = storage_mcap.deserialize_uint64(rest.read(8))[0]
    packed = rest.read(packed_size)
    if whole:
        return storage_mcap.decompress(packed, compression, size, crc)
    return unpacking.beginning(packed, compression)


def _sqlite(path: Path, wanted: Wanted) -> Iterator[Record]:
    with closing(_opened(path)) as database:
        try:
            database.execute("PRAGMA writable_schema=ON")  # else a file that was cut is not opened
            topics = {
                key: (topic, kind)
                for key, topic, kind in database.execute("SELECT id, name, type FROM topics")
                if wanted is None or topic in wanted
            }
            rows = database.execute(
                "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN "
                f"({','.join('?' * len(topics))}) ORDER BY rowid", list(topics),
            )  # fmt: skip
            for key, log_ns, data in rows:
                yield *topics[key], log_ns, data
        except sqlite3.DatabaseError as error:
            raise CutShortError(str(error)) from error


def _ros1(path: Path, wanted: Wanted) -> Iterator[Record]:
    connections: dict[int, tuple[str, str]] = {}
    with path.open("rb") as file:
        file.seek(len(_ROS1))
        for header, data in _ros1_records(file, path.stat().st_size):
            number = header.get_uint32("conn")
            if header.get_uint8("op") == ros1.RecordType.MSGDATA:
                topic, kind = connections[number]
                if wanted is None or topic in wanted:
                    yield topic, kind, header.get_time("time"), data
            elif number not in connections:
                said = ros1.Header.read(io.BytesIO(struct.pack("<I", len(data)) + data))
                topic = ros1.normalize(header.get_string("topic"))
                connections[number] = topic, normalize_msgtype(said.get_string("type"))


def _ros1_records(file: BinaryIO, end: int, depth: int = 0) -> Iterator[tuple[Any, bytes]]:
    """Connections and messages, those in chunks too.

    A chunk that was not finished says that it has 0 bytes: what is in it comes right after it.
    """
    kinds = ros1.RecordType
    while file.tell() < end:
        try:
            header = ros1.Header.read(file)
            size = ros1.read_uint32(file)
        except ros1.ReaderError as error:
            raise CutShortError(str(error)) from error
        kind, whole = header.get_uint8("op"), size <= end - file.tell()
        if kind not in (kinds.CHUNK, kinds.CONNECTION, kinds.MSGDATA):
            file.seek(size, os.SEEK_CUR)
        else:
            data = file.read(size)
            if kind == kinds.CHUNK and depth:
                raise ValueError(IN_CHUNK)
            if kind == kinds.CHUNK:
                compression = header.get_string("compression")
                inside = (
                    ros1.decompressors[compression](data)
                    if whole and size
                    else unpacking.beginning(data, compression)
                )
                yield from _ros1_records(io.BytesIO(inside), len(inside), depth + 1)
            elif whole:
                yield header, data
        if not whole:
            raise CutShortError("a record has no end")
