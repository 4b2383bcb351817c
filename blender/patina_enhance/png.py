# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG files from arrays, without Blender's colour management in between."""

import struct
import zlib

import numpy

COLOR_TYPES = {1: 0, 3: 2, 4: 6}


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_bytes(pixels):
    """pixels [H,W,C] uint8, C 1, 3 or 4, top row first → the file's bytes."""
    height, width, channels = pixels.shape
    header = struct.pack(">IIBBBBB", width, height, 8, COLOR_TYPES[channels], 0, 0, 0)
    rows = numpy.zeros(
        (height, 1 + width * channels), numpy.uint8
    )  # a zero before a row: no filter
    rows[:, 1:] = pixels.reshape(height, -1)
    body = zlib.compress(rows.tobytes(), 3)
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", header)
        + _chunk(b"IDAT", body)
        + _chunk(b"IEND", b"")
    )
