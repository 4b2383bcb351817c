# SPDX-License-Identifier: GPL-3.0-or-later
"""A binary glTF file, put together part by part. Needs no Blender.

In: arrays and dictionaries in glTF's own terms and axes. Out: the bytes of a .glb file.
"""

import json
import struct

import numpy

FLOAT, UNSIGNED_INT = 5126, 5125
WRAP = {"REPEAT": 10497, "EXTEND": 33071, "CLIP": 33071, "MIRROR": 33648}


class Glb:
    def __init__(self):
        self._binary = bytearray()
        self._json = {
            "asset": {"version": "2.0", "generator": "patina for Blender"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }

    def _add(self, kind, item):
        items = self._json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def _view(self, data):
        self._binary += b"\0" * (-len(self._binary) % 4)
        offset = len(self._binary)
        self._binary += data
        return self._add(
            "bufferViews", {"buffer": 0, "byteOffset": offset, "byteLength": len(data)}
        )

    def attribute(self, values, with_bounds=False):
        """values [N,2 or 3] f32 → index of the accessor."""
        accessor = {
            "bufferView": self._view(numpy.ascontiguousarray(values, numpy.float32).tobytes()),
            "componentType": FLOAT,
            "count": len(values),
            "type": f"VEC{values.shape[1]}",
        }
        if with_bounds:
            accessor["min"] = [float(v) for v in values.min(axis=0)]
            accessor["max"] = [float(v) for v in values.max(axis=0)]
        return self._add("accessors", accessor)

    def indices(self, values):
        """values [3 × triangles] → index of the accessor."""
        data = numpy.ascontiguousarray(values, numpy.uint32)
        accessor = {
            "bufferView": self._view(data.tobytes()),
            "componentType": UNSIGNED_INT,
            "count": data.size,
            "type": "SCALAR",
        }
        return self._add("accessors", accessor)

    def texture(self, png, extension):
        """A PNG file's bytes, and Blender's name of what lies beyond its edges → its index."""
        image = self._add("images", {"bufferView": self._view(png), "mimeType": "image/png"})
        wrap = WRAP[extension]
        sampler = self._add("samplers", {"wrapS": wrap, "wrapT": wrap})
        return self._add("textures", {"source": image, "sampler": sampler})

    def material(self, material):
        return self._add("materials", material)

    def mesh(self, name, primitives, translation):
        """A mesh on a node of its own in the scene."""
        mesh = self._add("meshes", {"name": name, "primitives": primitives})
        node = {"name": name, "mesh": mesh, "translation": [float(v) for v in translation]}
        self._json["scenes"][0]["nodes"].append(self._add("nodes", node))

    def use_extension(self, name):
        used = self._json.setdefault("extensionsUsed", [])
        if name not in used:
            used.append(name)

    def to_bytes(self):
        document = dict(self._json, buffers=[{"byteLength": len(self._binary)}])
        text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self._binary) + b"\0" * (-len(self._binary) % 4)
        size = 12 + 8 + len(text) + 8 + len(binary)
        return (
            struct.pack("<4sII", b"glTF", 2, size)
            + struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(binary), b"BIN\0")
            + binary
        )
