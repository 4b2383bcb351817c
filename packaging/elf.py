"""What the tables of an ELF file say, as binutils' readelf prints them."""

import re
import subprocess
from typing import NamedTuple


class Symbol(NamedTuple):
    name: str
    version: str  # "" where it has none


class Definition(NamedTuple):
    kind: str  # FUNC, OBJECT, TLS, IFUNC, ...
    size: int  # bytes


def _readelf(option, path):
    command = ["readelf", "--wide", option, str(path)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed(path):
    """The sonames of the libraries that a file asks for."""
    return re.findall(r"\(NEEDED\).*\[(.+)\]", _readelf("--dynamic", path))


def symbols(path):
    """(what the file asks of others: set of Symbol, what it defines: {Symbol: Definition})"""
    asked, defined = set(), {}
    for line in _readelf("--dyn-syms", path).splitlines():
        # Num: Value Size Type Bind Vis Ndx Name[@[@]Version]
        fields = line.split()
        if len(fields) < 8 or not fields[0].rstrip(":").isdigit():
            continue
        size, kind, visibility, section, name = fields[2], fields[3], fields[5], fields[6], fields[7]
        name, _, version = name.replace("@@", "@").partition("@")
        if section == "UND":
            asked.add(Symbol(name, version))
        elif visibility in ("DEFAULT", "PROTECTED"):
            defined[Symbol(name, version)] = Definition(kind, int(size, 0))
    return asked, defined


def libraries_of(program):
    """{soname: path} of all that the loader would map for a program; "" where it finds none."""
    output = subprocess.run(["ldd", str(program)], check=True, capture_output=True, text=True).stdout
    found = {}
    for line in output.splitlines():
        match = re.match(r"\s*(\S+) => (\S+)", line)
        if match:
            found[match[1]] = "" if match[2] == "not" else match[2]
    return found
