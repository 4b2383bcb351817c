# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests share: a clean scene, small objects, settings for quick runs."""

import os
import pathlib
import tempfile
import unittest

import bpy
import numpy

from patina_enhance import runner

numpy.bool = bool  # Debian's Blender 3.4 imports glTF with a name that Debian's numpy has dropped

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHARED = pathlib.Path(os.environ.get("PATINA_SHARED") or ROOT.parent / "shared")
PROGRAM = os.environ["PATINA_PROGRAM"]
STAND_IN = str(pathlib.Path(__file__).with_name("stand_in.py"))

# The smallest run that goes through all stages.
QUICK = """
steps = 1
guidance-scale = 1
fit-iterations = 6
resolution = 64
bias = 0
texture-size = 64
samples = 2
turntable = 0
threads = 1
"""


class BlenderTest(unittest.TestCase):
    """Starts with an empty scene, an empty folder and settings for a quick run of `program`."""

    program = PROGRAM

    def setUp(self):
        bpy.ops.wm.read_homefile(use_empty=True)
        temporary = tempfile.TemporaryDirectory(prefix="patina-test-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.blend = self.folder / "work.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(self.blend))
        preferences().program = self.program
        self.settings = bpy.context.scene.patina
        self.settings.prompt = "a rusty old kettle"
        self.settings.preset = "fast"
        self.set_options(QUICK)

    def set_options(self, toml):
        config = self.folder / "options.toml"
        config.write_text(toml, encoding="utf-8")
        self.settings.config = str(config)

    def enhance(self):
        """Runs to the end; returns the Runner."""
        self.assertEqual(bpy.ops.patina.enhance(), {"FINISHED"})
        self.assertTrue(runner.wait(), "the run did not end")
        run = runner.current()
        self.assertEqual(run.job.state, "finished", run.message)
        return run

    def refusal(self, operator):
        """The text with which an operator reports an error."""
        with self.assertRaises(RuntimeError) as caught:
            operator()
        return str(caught.exception)


def preferences():
    return bpy.context.preferences.addons["patina_enhance"].preferences


def select(*objects):
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def picture(name, values, packed=True, is_data=False):
    """An image of [H,W,3 or 4] values 0 to 1 as they are stored, bottom row first."""
    height, width = values.shape[:2]
    pixels = numpy.ones((height, width, 4), numpy.float32)
    pixels[..., : values.shape[2]] = values
    image = bpy.data.images.new(name, width, height, alpha=True)
    image.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
    image.pixels.foreach_set(pixels.ravel())
    if packed:
        image.pack()
    return image


def noise(size=32, seed=0):
    return numpy.random.default_rng(seed).random((size, size, 3), numpy.float32)


def material(name, base_color=None):
    """A material with a Principled BSDF, and an image as its base colour where one is given."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    if base_color is not None:
        node = made.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = base_color
        made.node_tree.links.new(node.outputs["Color"], principled(made).inputs["Base Color"])
    return made


def principled(made):
    return next(n for n in made.node_tree.nodes if n.type == "BSDF_PRINCIPLED")


def source_node(socket):
    return socket.links[0].from_node if socket.is_linked else None


def cube(name="cube", materials=(), size=1.0):
    bpy.ops.mesh.primitive_cube_add(size=size)
    made = bpy.context.active_object
    made.name = name
    for one in materials:
        made.data.materials.append(one)
    return made


def import_gltf(path):
    """Imports a file and selects its meshes."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(path))
    meshes = [o for o in bpy.data.objects if o not in before and o.type == "MESH" and o.users_scene]
    select(*meshes)
    return meshes
