#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Packs the extension: one .zip for Blender 4.2 and later (extension) and for older ones (add-on).

blender/package.py OUT.zip
"""

import pathlib
import sys
import zipfile

SOURCE = pathlib.Path(__file__).resolve().parent / "patina_enhance"


def pack(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(SOURCE.iterdir()):
            if file.is_file():
                archive.write(file, f"{SOURCE.name}/{file.name}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    pathlib.Path(sys.argv[1]).parent.mkdir(parents=True, exist_ok=True)
    pack(sys.argv[1])
