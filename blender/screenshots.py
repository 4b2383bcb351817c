# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the pictures of docs/blender.md: the panel before a run, while it works, and after it. The
docs show cuts of them.

    xvfb-run -s "-screen 0 1280x800x24" blender --factory-startup --enable-event-simulate \\
        --window-geometry 0 0 1280 800 --python blender/screenshots.py -- PROGRAM FOLDER
"""

import pathlib
import sys

import bpy
import numpy

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blender"))
numpy.bool = bool  # Debian's Blender 3.4 imports glTF with a name that Debian's numpy has dropped

import patina_enhance
from patina_enhance import runner

TAB_FROM_TOP = 165  # pixels
bpy.context.preferences.view.show_splash = False
program, folder = sys.argv[sys.argv.index("--") + 1 :]
folder = pathlib.Path(folder).resolve()


def viewport():
    window = bpy.context.window_manager.windows[0]
    area = max((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width)
    return window, area, next(r for r in area.regions if r.type == "WINDOW")


def prepare():
    preferences = bpy.context.preferences
    entry = preferences.addons.new()
    entry.module = "patina_enhance"
    patina_enhance.register()
    entry.preferences.program = str(pathlib.Path(program).resolve())
    for obj in list(bpy.context.scene.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.import_scene.gltf(filepath=str(ROOT / "examples" / "kettle.glb"))
    settings = bpy.context.scene.patina
    settings.prompt, settings.strength = "a rusty old kettle", 0.9
    settings.preset = "fast"
    options = folder / "options.toml"
    options.write_text("steps = 10\nfit-iterations = 12\nsamples = 16\n")
    settings.config = str(options)
    window, area, region = viewport()
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.object.select_all(action="SELECT")
        bpy.context.view_layer.objects.active = bpy.context.selected_objects[0]
        space = area.spaces.active
        space.show_region_ui, space.shading.type = True, "MATERIAL"
        space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
        space.overlay.show_outline_selected = space.show_gizmo = False


def choose_tab(value):
    """Moves to our tab, the fourth in the sidebar (NOTHING); then PRESS and RELEASE the button."""
    window, area, _ = viewport()
    side = next(r for r in area.regions if r.type == "UI")
    x, y = side.x + side.width - 12, side.y + side.height - TAB_FROM_TOP
    window.event_simulate("MOUSEMOVE" if value == "NOTHING" else "LEFTMOUSE", value, x=x, y=y)


def frame():
    window, area, region = viewport()
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.view3d.view_selected()


def shoot(name):
    window, area, _ = viewport()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.screen.screenshot(filepath=str(folder / name))


def steps():
    """One step a call: the window is drawn in between."""
    prepare()
    yield 1.0
    for value in ("NOTHING", "PRESS", "RELEASE"):
        choose_tab(value)
        yield 1.0
    frame()
    yield 3.0
    shoot("panel.png")
    bpy.ops.patina.enhance()
    while "detail" not in runner.current().progress.finished_stages:
        yield 0.5
    yield 3.0
    shoot("running.png")
    while runner.is_running():
        yield 0.5
    yield 8.0  # shaders are compiled
    shoot("finished.png")
    bpy.ops.wm.quit_blender()


script = steps()
bpy.app.timers.register(lambda: next(script, None), first_interval=2.0)
