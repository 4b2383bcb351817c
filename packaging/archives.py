#!/usr/bin/env python3
"""Writes the three packages of one tree (bundle.py).

packaging/archives.py TREE FOLDER

FOLDER/patina-<version>-linux-x86_64.tar.zst                     to unpack anywhere
FOLDER/patina3d-<version>-py3-none-manylinux_2_36_x86_64.whl     for pip; the index has another patina
FOLDER/patina_<version>_amd64.deb                                for Debian 12, Ubuntu 22.10 and later

The same tree gives the same bytes: dates are those of SOURCE_DATE_EPOCH, or of the last commit.
"""

import base64
import csv
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from pathlib import Path

import elf

SOURCE = Path(__file__).resolve().parent.parent
GLIBC = "2.36"  # what the packages promise to run with
SUMMARY = "Adds generated detail to the materials of 3D assets"
COMPRESSION = "-12"  # of zstd; -19 takes fourteen times as long for 8 % less


def date_of_source():
    """Seconds since 1970."""
    if "SOURCE_DATE_EPOCH" in os.environ:
        return int(os.environ["SOURCE_DATE_EPOCH"])
    log = ["git", "-C", str(SOURCE), "log", "-1", "--format=%ct"]
    return int(subprocess.run(log, check=True, capture_output=True, text=True).stdout)


def files_of(tree):
    return sorted(path for path in tree.rglob("*") if path.is_file())


def check_glibc(tree):
    """Ends the program if a file wants a newer glibc than is promised."""
    promised = tuple(map(int, GLIBC.split(".")))
    for path in [tree / "bin/patina", *(tree / "lib/patina").iterdir()]:
        for symbol in elf.symbols(path)[0]:
            match = re.fullmatch(r"GLIBC_(\d+)\.(\d+)(\.\d+)?", symbol.version)
            if match and (int(match[1]), int(match[2])) > promised:
                sys.exit(f"package: {path.name} wants {symbol.version} ({symbol.name}), the packages promise {GLIBC}; "
                         "build on Debian 12")


def write_tar(tree, version, date, folder):
    root = f"patina-{version}-linux-x86_64"
    path = folder / f"{root}.tar.zst"

    def plain(entry):
        entry.uid = entry.gid = 0
        entry.uname = entry.gname = ""
        entry.mtime = date
        return entry

    with open(path, "wb") as file:
        zstd = subprocess.Popen(["zstd", COMPRESSION, "--long=27", "-T0", "-q"], stdin=subprocess.PIPE, stdout=file)
        with tarfile.open(fileobj=zstd.stdin, mode="w|", format=tarfile.PAX_FORMAT) as tar:
            tar.add(tree, root, filter=plain)  # sorted by name
        zstd.stdin.close()
        if zstd.wait() != 0:
            sys.exit("package: zstd failed")
    return path


def write_wheel(tree, version, date, folder):
    """bin/ becomes scripts, lib/ and share/ data: pip puts them beside each other, as they are in the tree."""
    tag = f"py3-none-manylinux_{GLIBC.replace('.', '_')}_x86_64"
    info = f"patina3d-{version}.dist-info"
    metadata = (f"Metadata-Version: 2.1\nName: patina3d\nVersion: {version}\nSummary: {SUMMARY}\n"
                "License: Apache-2.0\nRequires-Python: >=3.8\nDescription-Content-Type: text/markdown\n\n"
                + (SOURCE / "README.md").read_text())
    wheel = f"Wheel-Version: 1.0\nGenerator: patina packaging\nRoot-Is-Purelib: false\nTag: {tag}\n"
    members = [(f"{info}/METADATA", metadata.encode(), 0o644), (f"{info}/WHEEL", wheel.encode(), 0o644),
               (f"{info}/licenses/LICENSE", (SOURCE / "LICENSE").read_bytes(), 0o644)]
    path, record = folder / f"patina3d-{version}-{tag}.whl", []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:

        def add(name, content, mode):
            entry = zipfile.ZipInfo(name, time.gmtime(date)[:6])
            entry.external_attr = (0o100000 | mode) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append((name, f"sha256={digest}", len(content)))

        for file in files_of(tree):
            relative = file.relative_to(tree)
            place = f"scripts/{relative.name}" if relative.parts[0] == "bin" else f"data/{relative}"
            add(f"patina3d-{version}.data/{place}", file.read_bytes(), file.stat().st_mode & 0o777)
        for member in members:
            add(*member)
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([*record, (f"{info}/RECORD", "", "")])
        add(f"{info}/RECORD", text.getvalue().encode(), 0o644)
    return path


def write_deb(tree, version, date, folder):
    """The tree becomes /usr. It depends on glibc alone; docs/packaging.md says why."""
    path = folder / f"patina_{version}_amd64.deb"
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        root = Path(temporary, "root")
        shutil.copytree(tree, root / "usr", copy_function=os.link)
        size = sum(file.stat().st_size for file in files_of(tree)) // 1024
        (root / "DEBIAN").mkdir()
        (root / "DEBIAN/control").write_text(
            f"Package: patina\nVersion: {version}\nArchitecture: amd64\nMaintainer: the patina developers\n"
            f"Installed-Size: {size}\nDepends: libc6 (>= {GLIBC})\nSection: graphics\nPriority: optional\n"
            f"Description: {SUMMARY}\n Rust, moss, wear, cracks, dust and age for the textures of a glTF or OBJ asset that you\n"
            " already have. Runs on the processor; a small model comes with it.\n")
        os.chmod(root, 0o755)
        command = ["dpkg-deb", "--root-owner-group", "-Zzstd", "-z12", "--build", str(root), str(path)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "SOURCE_DATE_EPOCH": str(date)})
    return path


def main(tree, folder):
    folder.mkdir(parents=True, exist_ok=True)
    check_glibc(tree)
    version = subprocess.run([tree / "bin/patina", "--version"], check=True, capture_output=True, text=True).stdout.split()[1]
    date = date_of_source()
    for file in tree.rglob("*"):
        os.utime(file, (date, date))
    total = sum(file.stat().st_size for file in files_of(tree))
    print(f"{total / 1e6:7.1f} MB  unpacked")
    for write in (write_tar, write_wheel, write_deb):
        path = write(tree, version, date, folder)
        print(f"{path.stat().st_size / 1e6:7.1f} MB  {path}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
