# SPDX-License-Identifier: Apache-2.0
"""Small files that unpack to very much are refused before they fill the memory."""

import bz2
import gzip
import lzma
import zlib
from pathlib import Path

import numpy as np
import pytest
from backports import zstd
from lz4.frame import compress as lz4_compress
from scipy.io import loadmat, savemat

from slam.errors import LogFormatError
from slam.logs import read_carmen, text, unpacking
from slam.logs.text import numbered_lines

PACKERS = {
    "zstd": (zstd.ZstdDecompressor, zstd.compress),
    "bz2": (bz2.BZ2Decompressor, bz2.compress),
    "lz4": (unpacking.LZ4FrameDecompressor, lz4_compress),
}


@pytest.mark.parametrize("name", PACKERS)
def test_a_chunk_is_unpacked_up_to_its_limit(name):
    make, pack = PACKERS[name]
    content = bytes(range(256)) * 400
    packed = pack(content)
    assert unpacking.bounded(make(), packed, len(content)) == content
    with pytest.raises(ValueError, match="unpacks to more than 102399 bytes"):
        unpacking.bounded(make(), packed, len(content) - 1)
    with pytest.raises(ValueError, match="ends before its end"):
        unpacking.bounded(make(), packed[:-8], len(content))


def test_the_library_unpacks_chunks_by_these():
    unpack = unpacking.storage_mcap.DECOMPRESSORS["zstd"]
    with pytest.raises(ValueError, match="a chunk claims 10000000000 bytes"):
        unpack(zstd.compress(b"x"), 10**10)
    with pytest.raises(ValueError, match="more than 5 bytes"):
        unpack(zstd.compress(bytes(1000)), 5)
    assert unpacking.ros1.decompressors["bz2"](bz2.compress(b"abc")) == b"abc"
    assert unpacking.of_message(zstd.compress(b"abc")) == b"abc" == unpacking.of_message(b"abc")


@pytest.mark.parametrize(("suffix", "pack"), [(".gz", gzip.compress), (".xz", lzma.compress)])
def test_a_text_log_unpacks_up_to_a_limit(tmp_path: Path, monkeypatch, suffix, pack):
    monkeypatch.setattr(text, "MAX_TEXT_BYTES", 100_000)
    path = tmp_path / f"bomb.log{suffix}"
    path.write_bytes(pack(b"# nothing at all\n" * 10_000))
    with pytest.raises(LogFormatError, match=r"bomb.*:\d+: unpacks to more than 100000 bytes"):
        read_carmen(path)


def test_an_xz_file_reads_as_lzma_reads_it(tmp_path: Path):
    lines = [f"line {k}" for k in range(5000)]
    data = "".join(line + "\n" for line in lines).encode()
    path = tmp_path / "a.log.xz"
    for packed in (
        lzma.compress(data, preset=9),
        lzma.compress(data[:1000]) + lzma.compress(data[1000:]),
    ):
        path.write_bytes(packed)
        assert [line for _, line in numbered_lines(path)] == lines
    path.write_bytes(lzma.compress(data)[:-20])
    with pytest.raises(LogFormatError, match="corrupt or truncated"):
        list(numbered_lines(path))


def test_an_xz_file_that_claims_a_huge_dictionary_is_refused(tmp_path: Path):
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 0, "dict_size": 1 << 29}]
    packer = lzma.LZMACompressor(lzma.FORMAT_XZ, filters=filters)
    path = tmp_path / "a.log.xz"
    path.write_bytes(packer.compress(b"# a line\n") + packer.flush())
    with pytest.raises(LogFormatError, match=r"[Mm]emory"):
        list(numbered_lines(path))


def test_a_matlab_file_is_measured_before_it_is_loaded(tmp_path: Path, monkeypatch):
    path = tmp_path / "a.mat"
    savemat(path, {"zeros": np.zeros(100_000), "b": np.arange(3)}, do_compression=True)
    unpacking.check_mat(path)
    assert loadmat(path)["zeros"].size == 100_000
    monkeypatch.setattr(unpacking, "MAX_MAT_BYTES", 500_000)
    with pytest.raises(LogFormatError, match=r"a\.mat: unpacks to more than 500000 bytes"):
        unpacking.check_mat(path)
    path.write_bytes(bytes(128) + b"\x0f\0\0\0\xff\xff\xff\xff" + zlib.compress(bytes(9))[:5])
    unpacking.check_mat(path)  # what is damaged is for the reader to say
