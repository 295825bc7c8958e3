"""Checksums against zlib and binascii, for few and for many frames."""

from __future__ import annotations

import binascii
import zlib

import numpy as np
import pytest
from frames import encoders

from gyronorth.frames.checksums import crc_lsb, crc_msb, fletcher_16, int24


@pytest.mark.parametrize("count", [1, 31, 32, 200])
def test_sums_of_many_frames(count):
    rows = np.random.default_rng(count).integers(0, 256, (count, 37), dtype=np.uint8)
    texts = [row.tobytes() for row in rows]
    assert crc_msb(rows, 16, 0x1021, 0xFFFF).tolist() == [binascii.crc_hqx(text, 0xFFFF) for text in texts]
    assert crc_msb(rows, 32, 0x04C11DB7, 0xFFFFFFFF).tolist() == [encoders.crc32_msb(text) for text in texts]
    assert crc_lsb(rows, 16, 0x8408, 0).tolist() == [encoders.crc16_sbg(text) for text in texts]
    assert crc_lsb(rows, 32, 0xEDB88320, 0xFFFFFFFF).tolist() == [zlib.crc32(text) ^ 0xFFFFFFFF for text in texts]
    assert fletcher_16(rows).tolist() == [int.from_bytes(encoders.fletcher(text), "big") for text in texts]


def test_published_check_values():
    """Of the nine digits, as in the catalogue of parametrised CRC algorithms (G. Cook)."""
    digits = np.frombuffer(b"123456789", np.uint8)[None]
    assert crc_msb(digits, 32, 0x04C11DB7, 0xFFFFFFFF)[0] == 0x0376E6E7  # CRC-32/MPEG-2: STIM, KVH
    assert crc_msb(digits, 16, 0x1021, 0xFFFF)[0] == 0x29B1  # CRC-16/IBM-3740: ANPP
    assert crc_msb(digits, 16, 0x1021, 0)[0] == 0x31C3  # CRC-16/XMODEM: VectorNav
    assert crc_lsb(digits, 16, 0x8408, 0)[0] == 0x2189  # CRC-16/KERMIT: sbgECom


def test_signed_24_bits():
    values = [0, 1, -1, 2**23 - 1, -(2**23), 4660]
    rows = np.frombuffer(b"".join(value.to_bytes(3, "big", signed=True) for value in values), np.uint8)[None]
    assert int24(rows, 0, 6)[0].tolist() == values
