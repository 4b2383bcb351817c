# SPDX-License-Identifier: GPL-3.0-or-later
"""patina for Blender: generated detail for the materials of the selected objects.

The extension starts the program patina and reads what it reports; it holds no code of patina.
"""

bl_info = {
    "name": "patina",
    "author": "The patina authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > patina, and Material Properties",
    "description": "Add generated detail to the materials of your objects",
    "category": "Material",
}

from . import operators, panels, runner, settings

MODULES = (settings, operators, panels, runner)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
