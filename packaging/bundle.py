#!/usr/bin/env python3
"""Makes the tree that every package of patina holds, from a build folder.

packaging/bundle.py BUILD TREE

TREE/bin/patina                      the program, which finds the rest by its own place
TREE/lib/patina/                     the shared libraries it needs, but for glibc's, which are the system's
TREE/share/patina/                   patina-mini, the example asset
TREE/share/doc/patina/               licence, README, CHANGELOG, licences of everything inside

The libraries are Debian's files, unchanged; stand_in.py makes those that patina never calls.
"""

import fnmatch
import os
import shutil
import subprocess
import sys
from pathlib import Path

import elf
import licences
import stand_in

# The system's: glibc and the loader belong together and to the kernel's distribution.
SYSTEM = ("ld-linux-x86-64.so.*", "libc.so.*", "libm.so.*", "libmvec.so.*", "libpthread.so.*", "libdl.so.*",
          "librt.so.*", "libresolv.so.*", "libutil.so.*")

# Asked for by the libraries below, never called by patina (docs/packaging.md says how that was found and is tested).
UNUSED = (
    # OpenImageIO's, for image files that patina does not read or writes by itself, and for colour management
    "libopencv_*", "libdcm*", "libofstd.so.*", "liboflog.so.*", "libav*.so.*", "libsw*.so.*", "libgif.so.*",
    "libheif.so.*", "libopenjp2.so.*", "libopenvdb.so.*", "libraw_r.so.*", "libtiff.so.*", "libwebpdemux.so.*",
    "libOpenColorIO.so.*", "libfreetype.so.*",
    # LibTorch's, for data bases, several machines, ONNX files and phones
    "liblmdb.so.*", "libleveldb.so.*", "libsnappy.so.*", "libzmq.so.*", "libzstd.so.*", "libtensorpipe.so.*",
    "libgloo.so.*", "libonnx.so.*", "libXNNPACK.so.*", "libOpenCL.so.*",
    # linear algebra in Fortran, of which OpenBLAS and LibTorch hold the solvers
    "liblapack.so.*", "libgfortran.so.*",
)


def is_among(soname, patterns):
    return any(fnmatch.fnmatch(soname, pattern) for pattern in patterns)


def closure(program):
    """({soname: path} of the libraries to pack, {soname: path} of those to stand in for)"""
    found = elf.libraries_of(program)
    packed, unused, queue = {}, {}, [program]
    while queue:
        for soname in elf.needed(queue.pop()):
            if soname in packed or soname in unused or is_among(soname, SYSTEM):
                continue
            path = found.get(soname)
            if not path:
                sys.exit(f"package: {program} needs {soname}, which is not on this machine; scripts/setup.sh installs it")
            if is_among(soname, UNUSED):
                unused[soname] = path
            else:
                packed[soname] = path
                queue.append(path)
    return packed, unused


def make_stand_ins(program, packed, unused, folder):
    asked, known = set(), set()
    for path in [program, *packed.values()]:
        its_asked, its_defined = elf.symbols(path)
        asked |= its_asked
        known |= its_defined.keys()
    for soname, path in unused.items():
        defined = elf.symbols(path)[1]
        wanted = {symbol: defined[symbol] for symbol in asked - known if symbol in defined}
        stand_in.make(soname, wanted, folder / soname)


def bundle(build, tree):
    shutil.rmtree(tree, ignore_errors=True)
    install = ["cmake", "--install", str(build), "--component", "program", "--strip", "--prefix", str(tree)]
    subprocess.run(install, check=True, stdout=subprocess.DEVNULL)
    program, folder = tree / "bin/patina", tree / "lib/patina"
    folder.mkdir(parents=True)
    packed, unused = closure(build / "patina")
    for soname, path in packed.items():
        shutil.copyfile(os.path.realpath(path), folder / soname)
        os.chmod(folder / soname, 0o644)
    make_stand_ins(program, packed, unused, folder)
    licences.write(packed, tree / "share/doc/patina")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    bundle(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
