#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands in for `patina enhance` where a test is about Blender's side: says the same events and
leaves the same files, with random pictures in place of results. Whole runs use the real program."""

import json
import os
import random
import struct
import sys
import zlib

SIZE = 16


def write_picture(path, seed):
    rows = random.Random(seed).randbytes(3 * SIZE * SIZE)
    body = b"".join(b"\0" + rows[3 * SIZE * y : 3 * SIZE * (y + 1)] for y in range(SIZE))
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(body)),
        (b"IEND", b""),
    )
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in parts:
            file.write(struct.pack(">I", len(data)) + kind + data)
            file.write(struct.pack(">I", zlib.crc32(kind + data)))


def say(**event):
    print(json.dumps(event), file=sys.stderr, flush=True)


def main():
    arguments = sys.argv[1:]
    assert arguments[0] == "enhance", arguments
    values = {}
    for argument in arguments:
        if argument.startswith("--") and "=" in argument:
            name, _, value = argument[2:].partition("=")
            values.setdefault(name, []).append(value)
    run = arguments[arguments.index("--run") + 1]
    with open(arguments[1], "rb") as file:
        size = struct.unpack("<I", file.read(20)[12:16])[0]
        names = [m["name"] for m in json.loads(file.read(size))["materials"]]
    for stage in ("render", "detail", "fit", "report"):
        say(event="stage", stage=stage, state="started")
        say(event="progress", stage=stage, task=stage, share=1.0, seconds_left=0.0)
        if stage == "render":
            write_picture(os.path.join(run, "views", "tile_00.png"), stage)
        if stage == "detail":
            write_picture(os.path.join(run, "detail", "edited_00.png"), stage)
        say(event="stage", stage=stage, state="finished")
    maps = []
    for index, name in enumerate(names):
        for slot in values["fit"] if name in values["material"] else ():
            maps.append({"material": index, "slot": slot, "file": f"textures/{index}_{slot}.png"})
            write_picture(os.path.join(run, maps[-1]["file"]), f"{index} {slot}")
    for file, content in (
        ("stages.json", json.dumps([{"name": "fit", "metrics": {"maps": maps}}])),
        ("report.html", "<p>report"),
        ("arguments.json", json.dumps(arguments)),
    ):
        with open(os.path.join(run, file), "w", encoding="utf-8") as out:
            out.write(content)
    say(event="result", report=os.path.join(run, "report.html"))


main()
