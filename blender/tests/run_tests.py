# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside Blender: installs the packed extension, then runs all tests, or those that are named.

    blender -b --factory-startup --python run_tests.py -- EXTENSION.zip [test_export.Shapes ...]

Ends with one line: N passed, N failed, N skipped.
"""

import pathlib
import sys
import unittest

import bpy

FOLDER = pathlib.Path(__file__).resolve().parent


def main(extension, names):
    bpy.ops.preferences.addon_install(filepath=extension)
    bpy.ops.preferences.addon_enable(module="patina_enhance")
    sys.path.insert(0, str(FOLDER))
    loader = unittest.TestLoader()
    tests = loader.loadTestsFromNames(names) if names else loader.discover(str(FOLDER))
    result = unittest.TextTestRunner(stream=sys.stderr, verbosity=2).run(tests)
    failed, skipped = len(result.failures) + len(result.errors), len(result.skipped)
    print(
        f"{result.testsRun - failed - skipped} passed, {failed} failed, {skipped} skipped",
        file=sys.stderr,
    )
    return 0 if failed == 0 and result.testsRun > 0 else 1


arguments = sys.argv[sys.argv.index("--") + 1 :]
sys.exit(main(arguments[0], arguments[1:]))
