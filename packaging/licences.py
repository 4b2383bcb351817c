"""The licences of everything that a package holds and patina did not write, from Debian's own records."""

import os
import re
import subprocess
from pathlib import Path

DOC = Path("/usr/share/doc")
COMMON = Path("/usr/share/common-licenses")
SOURCE = Path(__file__).resolve().parent.parent

# Compiled into the program from headers alone.
HEADER_PACKAGES = ("libcli11-dev", "libglm-dev", "libtomlplusplus-dev", "nlohmann-json3-dev")


def package_of(path):
    """The Debian package that a file came with; /lib is a link to /usr/lib, and dpkg knows either name."""
    real = os.path.realpath(path)
    for name in (path, real, real.removeprefix("/usr"), "/usr" + real):
        answer = subprocess.run(["dpkg-query", "--search", name], capture_output=True, text=True)
        if answer.returncode == 0:
            return answer.stdout.split(": ")[0].split(",")[0].split(":")[0]
    raise SystemExit(f"package: {path} is of no Debian package, so that its licence is not known")


def source_and_version(package):
    query = ["dpkg-query", "--show", "--showformat", "${source:Package} ${source:Version}\n", package]
    lines = subprocess.run(query, check=True, capture_output=True, text=True).stdout.split("\n")
    return tuple(lines[0].split())


def write(packed, folder):
    """packed: {soname: path}. Writes copyright and the licence texts that it refers to into `folder`."""
    libraries = {}  # of a Debian source package
    packages = {}   # one of its binary packages, for the text
    for soname, path in packed.items():
        package = package_of(path)
        source = source_and_version(package)
        libraries.setdefault(source, []).append(soname)
        packages[source] = package
    for package in HEADER_PACKAGES:
        source = source_and_version(package)
        libraries[source] = ["(headers, compiled into the program)"]
        packages[source] = package

    text = ["patina is under Apache-2.0 (LICENSE), the weights of patina-mini are under CC0-1.0. This package also holds\n"
            "what follows, unchanged, from Debian: the libraries in lib/patina and headers that were compiled into the\n"
            "program. Their sources: https://snapshot.debian.org/package/SOURCE/VERSION/. Debian's record of the\n"
            "copyrights and licences of each source follows the table; it speaks of the whole source, of which some parts\n"
            "are not in here. Files of lib/patina that the table does not name hold no code of others: they stand in\n"
            "for libraries that patina does not use.\n\n"]
    for (source, version), names in sorted(libraries.items()):
        text.append(f"{source:<24} {version:<28} {' '.join(sorted(names))}\n")
    text.append(f"{'three.js':<24} {'r168':<28} (embedded in the program, which writes it into its reports)\n")
    for source in sorted(libraries):
        text.append(f"\n\n{'=' * 100}\n{source[0]} {source[1]}\n{'=' * 100}\n\n")
        text.append((DOC / packages[source] / "copyright").read_text(encoding="utf-8", errors="replace"))
    text.append(f"\n\n{'=' * 100}\nthree.js r168\n{'=' * 100}\n\n")
    text.append((SOURCE / "third_party/three/LICENSE").read_text())
    whole = "".join(text)
    (folder / "copyright").write_text(whole)
    common = folder / "common-licenses"
    common.mkdir()
    for name in sorted(set(re.findall(r"/usr/share/common-licenses/([A-Za-z0-9.+-]*[A-Za-z0-9])", whole))):
        if (COMMON / name).exists():
            (common / name).write_bytes((COMMON / name).read_bytes())
