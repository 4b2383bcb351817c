"""Stand-ins for libraries that patina never calls.

Debian's OpenImageIO and LibTorch are linked to some two hundred and fifty libraries for features that patina does not
use: videos, medical images, maps, OpenCV's windows. The loader wants each library with each symbol that was linked, so
a package cannot simply leave them out. A stand-in is a library of the same soname that defines just the symbols that
the packed libraries ask for. A function of it says its name and ends the program; data is zero.
"""

import subprocess
import tempfile
from pathlib import Path

# What OpenImageIO calls when it is loaded and makes its list of formats: medical images register themselves, others say
# their version. They return an empty text, which is right for the latter and harmless for the former.
AT_LOAD = ("_ZN10DiRegisterC1Ev", "_ZN10DiRegisterD1Ev", "TIFFGetVersion", "opj_version", "heif_get_version",
           "libraw_version",
           "TIFFSetErrorHandler", "TIFFSetErrorHandlerExt", "TIFFSetWarningHandler", "TIFFSetWarningHandlerExt")

HEAD = """\
#include <string.h>
#include <unistd.h>
static void absent(const char* name) {
  static const char text[] = "patina: this package does without %s, but it was called: ";
  (void)!write(2, text, sizeof text - 1);
  (void)!write(2, name, strlen(name));
  (void)!write(2, "\\n", 1);
  _exit(1);
}
"""


def make(soname, wanted, path):
    """Compiles a stand-in; wanted: {elf.Symbol: elf.Definition} of the library that it stands for."""
    names = [symbol.name for symbol in wanted]
    if len(names) != len(set(names)):
        raise SystemExit(f"package: {soname} is asked for one symbol in two versions, which stand_in.py cannot make")
    source, versions = [HEAD % soname], {}
    for symbol, definition in sorted(wanted.items()):
        if definition.kind in ("FUNC", "IFUNC"):
            body = 'return "";' if symbol.name in AT_LOAD else "absent(__func__);"
            source.append(f"const char* {symbol.name}(void) {{ {body} }}\n")
        elif definition.kind == "OBJECT":
            source.append(f"char {symbol.name}[{max(definition.size, 1)}] __attribute__((aligned(32)));\n")
        else:
            raise SystemExit(f"package: {soname}: {symbol.name} is of kind {definition.kind}; "
                             "take the library out of the list of unused ones")
        versions.setdefault(symbol.version, []).append(symbol.name)
    script = [f'{version} {{ global: {"; ".join(names)}; }};\n' for version, names in versions.items() if version]
    with tempfile.TemporaryDirectory() as folder:
        code, versions_file = Path(folder, "stand_in.c"), Path(folder, "versions")
        code.write_text("".join(source))
        versions_file.write_text("".join(script))
        command = ["gcc", "-Os", "-w", "-fPIC", "-ffreestanding", "-fno-asynchronous-unwind-tables", "-shared", "-s",
                   f"-Wl,-soname,{soname}", "-o", str(path), str(code)]
        if script:
            command.append(f"-Wl,--version-script={versions_file}")
        subprocess.run(command, check=True)
