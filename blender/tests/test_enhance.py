# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs: what the buttons do, and what of a scene is the same afterwards."""

import json
import os
import stat
import time

import bpy
import numpy
import support
from patina_enhance import assign, job, preview, runner
from support import (
    BlenderTest,
    cube,
    import_gltf,
    material,
    noise,
    picture,
    principled,
    select,
    source_node,
)

ALPHABETS = '錆びた鉄 – ржавчина 🦀 "q"'


def snapshot(made):
    """Everything of a material's nodes that could change: values, images, links."""
    nodes, links = {}, set()
    for node in made.node_tree.nodes:
        values = {}
        for i, socket in enumerate(node.inputs):
            value = getattr(socket, "default_value", None)
            values[i] = (
                tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
            )
        image = getattr(node, "image", None)
        nodes[node.name] = (node.type, values, image.name if image else None)
    for link in made.node_tree.links:
        links.add(
            (
                link.from_node.name,
                link.from_socket.identifier,
                link.to_node.name,
                link.to_socket.identifier,
            )
        )
    return nodes, links


def textured_scene():
    """Two objects with two materials: packed and unpacked images, sockets that glTF does not know,
    a bump node, a subdivided and scaled object."""
    rust = material("rust", picture("rust colours", noise(seed=1)))
    bsdf = principled(rust)
    bsdf.inputs["Subsurface"].default_value, bsdf.inputs["Sheen"].default_value = 0.3, 0.4
    bsdf.inputs["Subsurface Color"].default_value = (0.1, 0.2, 0.3, 1)
    bump = rust.node_tree.nodes.new("ShaderNodeBump")
    waves = rust.node_tree.nodes.new("ShaderNodeTexWave")
    rust.node_tree.links.new(waves.outputs["Color"], bump.inputs["Height"])
    rust.node_tree.links.new(bump.outputs["Normal"], bsdf.inputs["Normal"])
    moss = material("moss", picture("moss colours", noise(seed=2), packed=False))
    one, two = cube("one", [rust, moss]), cube("two", [moss])
    for polygon in list(one.data.polygons)[:3]:
        polygon.material_index = 1
    two.location, two.scale = (0, 1.5, 0), (1, 0.5, 2)
    two.modifiers.new("smooth", "SUBSURF")
    select(one, two)
    bpy.context.view_layer.update()
    return rust, moss


class Runs(BlenderTest):
    """Of the real program, on three assets."""

    def check_new_maps(self, made):
        self.assertTrue(assign.has_record(made))
        for name, space in (("Base Color", "sRGB"), ("Roughness", "Non-Color")):
            image = source_node(principled(made).inputs[name]).image
            self.assertEqual(image.colorspace_settings.name, space)
            self.assertIsNotNone(image.packed_file)
            values = numpy.array(image.pixels[:])
            self.assertTrue(numpy.isfinite(values).all())
            self.assertGreater(
                values.reshape(-1, 4)[:, 0].std(), 1e-4, f"{name} of {made.name} is plain"
            )

    def test_kettle(self):
        import_gltf(support.ROOT / "examples" / "kettle.glb")
        self.settings.prompt = ALPHABETS
        run = self.enhance()
        self.assertEqual(run.job.warnings, [])
        for name in ("enamel", "steel"):  # of the knob, the wood, small views see too little
            self.check_new_maps(bpy.data.materials[name])
        self.assertTrue(os.path.exists(run.job.report))
        with open(os.path.join(run.job.run, "config.json"), encoding="utf-8") as file:
            self.assertIn(json.dumps(ALPHABETS), json.dumps(json.load(file)))

    def test_water_bottle(self):
        asset = support.SHARED / "assets" / "WaterBottle" / "WaterBottle.gltf"
        if not asset.exists():
            self.skipTest(f"needs {asset}")
        import_gltf(asset)
        self.enhance()
        made = bpy.data.materials["BottleMat"]
        self.check_new_maps(made)
        self.assertEqual(source_node(principled(made).inputs["Normal"]).type, "NORMAL_MAP")
        self.assertTrue(principled(made).inputs["Emission"].is_linked)

    def test_scene_of_two_objects(self):
        rust, moss = textured_scene()
        self.enhance()
        for made in (rust, moss):
            self.check_new_maps(made)

    def test_draft_shows_views_in_the_light_of_the_world_and_changes_nothing(self):
        made = material("m", picture("colours", noise()))
        select(cube(materials=[made]))
        bpy.context.scene.world = bpy.data.worlds.new("world")
        self.settings.environment = "WORLD"
        before = snapshot(made)
        self.assertEqual(bpy.ops.patina.draft(), {"FINISHED"})
        self.assertTrue(runner.wait())
        self.assertEqual(runner.current().job.state, "finished", runner.current().message)
        self.assertEqual(tuple(bpy.data.images[preview.NAME].size), (128, 128))
        self.assertGreater(numpy.std(bpy.data.images[preview.NAME].pixels[:]), 0.05)
        icon = bpy.data.images[preview.NAME].preview
        self.assertEqual(tuple(icon.image_size), (128, 128))
        self.assertGreater(numpy.std(icon.image_pixels_float[:]), 0.05)
        self.assertEqual(snapshot(made), before)
        light = os.path.join(runner.current().job.folder, "environment.exr")
        self.assertTrue(os.path.exists(light))
        self.assertIn(f"--environment={light}", runner.current().job.commands[0])


class Enhance(BlenderTest):
    """Blender's side of a run."""

    program = support.STAND_IN

    def test_only_the_chosen_maps_change(self):
        rust, moss = textured_scene()
        before = {m.name: snapshot(m) for m in (rust, moss)}
        objects = {o.name: (o.matrix_world.copy(), len(o.data.vertices)) for o in bpy.data.objects}
        self.settings.maps = {"base_color", "normal"}
        moss.patina_settings.enhance = False
        self.enhance()
        self.assertEqual(snapshot(moss), before["moss"])
        nodes, links = snapshot(rust)
        old_nodes, old_links = before["rust"]
        self.assertEqual({name: nodes[name] for name in old_nodes}, old_nodes)
        bump = source_node(principled(rust).inputs["Normal"])
        targets = {(principled(rust).name, "Base Color"), (bump.name, "Normal")}
        changed = {link[2:] for link in links ^ old_links}
        self.assertEqual({link for link in changed if link[0] in old_nodes}, targets)
        self.assertEqual(bump.type, "BUMP")  # it acts on the new normals
        self.assertEqual(source_node(bump.inputs["Normal"]).type, "NORMAL_MAP")
        self.assertEqual(
            source_node(principled(rust).inputs["Base Color"]).image.name, "rust base_color"
        )
        for name, (matrix, vertices) in objects.items():
            self.assertEqual(bpy.data.objects[name].matrix_world, matrix)
            self.assertEqual(len(bpy.data.objects[name].data.vertices), vertices)

    def test_compare_and_undo_go_back(self):
        rust, moss = textured_scene()
        before = {m.name: snapshot(m) for m in (rust, moss)}
        images = {i.name for i in bpy.data.images}
        bpy.ops.ed.undo_push(message="scene")
        self.enhance()
        rust = bpy.data.materials["rust"]
        new = {
            name: source_node(principled(rust).inputs[name]).name
            for name in ("Base Color", "Roughness")
        }

        bpy.ops.patina.compare()
        self.assertFalse(assign.shows_new(rust))
        _, links = snapshot(rust)
        shown = {link for link in links if link[2] in before["rust"][0]}
        self.assertEqual(shown, before["rust"][1])
        bpy.ops.patina.compare()
        again = {name: source_node(principled(rust).inputs[name]).name for name in new}
        self.assertEqual(again, new)

        # One step takes back all that the run did.
        bpy.ops.ed.undo()
        for name, state in before.items():
            self.assertEqual(snapshot(bpy.data.materials[name]), state)
        self.assertEqual({i.name for i in bpy.data.images} - {preview.NAME}, images)

    def test_a_second_run_compares_with_the_first(self):
        made = material("m", picture("colours", noise()))
        select(cube(materials=[made]))
        self.settings.maps = {"base_color"}
        self.enhance()
        first = source_node(principled(made).inputs["Base Color"]).name
        self.enhance()
        self.assertNotEqual(source_node(principled(made).inputs["Base Color"]).name, first)
        bpy.ops.patina.compare()
        self.assertEqual(source_node(principled(made).inputs["Base Color"]).name, first)

    def test_new_images_go_beside_the_blend_file(self):
        made = material("föhn / 1", picture("colours", noise()))
        select(cube(materials=[made]))
        self.settings.images, self.settings.maps = "FILES", {"base_color"}
        older = self.folder / "textures" / "patina" / "föhn_1_base_color_001.png"
        older.parent.mkdir(parents=True)
        older.write_bytes(b"of another run")
        self.enhance()
        image = source_node(principled(made).inputs["Base Color"]).image
        self.assertIsNone(image.packed_file)
        self.assertEqual(image.filepath, "//textures/patina/föhn_1_base_color_002.png")
        self.assertTrue(os.path.exists(bpy.path.abspath(image.filepath)))
        self.assertEqual(older.read_bytes(), b"of another run")

    def test_arguments_arrive_as_they_are(self):
        select(cube("куб", [material("素材, --x", picture("colours", noise()))]))
        self.settings.prompt, self.settings.negative_prompt = ALPHABETS, "-naïve"
        run = self.enhance()
        with open(os.path.join(run.job.run, "arguments.json"), encoding="utf-8") as file:
            arguments = json.load(file)
        for wanted in ("--prompt=" + ALPHABETS, "--negative-prompt=-naïve", "--material=素材, --x"):
            self.assertIn(wanted, arguments)
        self.assertTrue(assign.has_record(bpy.data.materials["素材, --x"]))


class Stop(BlenderTest):
    def test_cancel_in_the_middle_and_resume(self):
        made = material("m", picture("colours", noise()))
        select(cube(materials=[made]))
        before = snapshot(made)
        self.set_options(support.QUICK.replace("fit-iterations = 6", "fit-iterations = 20000"))
        bpy.ops.patina.enhance()
        run = runner.current()
        end = time.monotonic() + 600
        while "detail" not in run.progress.finished_stages and time.monotonic() < end:
            self.assertTrue(run.look(), run.message)
            time.sleep(0.05)
        self.assertFalse(bpy.ops.patina.enhance.poll(), "two runs at once")
        bpy.ops.patina.cancel()
        self.assertTrue(runner.wait())
        self.assertEqual((run.job.state, run.is_error), ("stopped", False), run.message)
        self.assertEqual(snapshot(made), before)

        self.set_options(support.QUICK)
        self.settings.prompt = "other words that Resume does not take"
        bpy.ops.patina.resume()
        self.assertTrue(runner.wait())
        self.assertEqual(runner.current().job.state, "finished", runner.current().message)
        self.assertIn("detail", runner.current().progress.finished_stages)
        self.assertTrue(assign.has_record(made))
        self.assertFalse(bpy.ops.patina.resume.poll())

    def test_another_file_stops_the_run(self):
        select(cube(materials=[material("m", picture("colours", noise()))]))
        bpy.ops.patina.enhance()
        folder = runner.current().job.folder
        process = runner.current()._process
        bpy.ops.wm.read_homefile(use_empty=True)
        self.assertFalse(runner.is_running())
        process.wait(600)
        self.assertTrue(process.done)
        self.assertEqual(job.load_job(folder).state, "stopped")


class Refusals(BlenderTest):
    def test_missing_program(self):
        select(cube(materials=[material("m")]))
        support.preferences().program = "/no/such/patina"
        self.assertIn("'/no/such/patina' is no program", self.refusal(bpy.ops.patina.enhance))

    def test_program_that_cannot_run(self):
        program = self.folder / "broken"
        program.write_bytes(b"not a program")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        support.preferences().program = str(program)
        select(cube(materials=[material("m")]))
        bpy.ops.patina.enhance()
        self.assertTrue(runner.wait())
        self.assertEqual(runner.current().job.state, "failed")
        self.assertIn(str(program), runner.current().message)

    def test_errors_of_the_program_are_shown(self):
        select(cube(materials=[material("m")]))
        self.settings.model = "no-such-model"
        bpy.ops.patina.enhance()
        self.assertTrue(runner.wait())
        self.assertEqual(runner.current().job.state, "failed")
        self.assertIn("no-such-model", runner.current().message)

    def test_asset_without_uvs_is_refused_and_unwrapped(self):
        box = cube("bare", [material("m")])
        box.data.uv_layers.remove(box.data.uv_layers[0])
        point = cube("point", [material("n")])
        for corner in point.data.uv_layers[0].data:
            corner.uv = (0.5, 0.5)
        select(box, point)
        text = self.refusal(bpy.ops.patina.enhance)
        self.assertIn("'bare', 'point'", text)
        self.assertIn("Smart UV Project", text)
        self.assertEqual(bpy.ops.patina.unwrap(), {"FINISHED"})
        self.assertEqual({o.name for o in bpy.context.selected_objects}, {"bare", "point"})
        self.assertFalse(bpy.ops.patina.unwrap.poll())
        support.preferences().program = support.STAND_IN
        self.enhance()
        self.assertTrue(principled(box.data.materials[0]).inputs["Base Color"].is_linked)

    def test_what_cannot_be_enhanced_is_named(self):
        plain = bpy.data.materials.new("plain")
        select(cube("nothing"))
        self.assertIn("'nothing' has no material", self.refusal(bpy.ops.patina.enhance))
        select(cube("box", [plain]))
        self.assertIn("'plain' has no Principled BSDF", self.refusal(bpy.ops.patina.enhance))
        for obj in bpy.context.scene.objects:
            obj.select_set(False)
        self.assertIn("No mesh is selected", self.refusal(bpy.ops.patina.enhance))
        self.settings.prompt = " "
        self.assertIn("prompt", self.refusal(bpy.ops.patina.enhance))


class Install(BlenderTest):
    def test_it_can_be_switched_off_and_on(self):
        bpy.ops.preferences.addon_disable(module="patina_enhance")
        self.assertFalse(hasattr(bpy.types.Scene, "patina"))
        bpy.ops.preferences.addon_enable(module="patina_enhance")
        self.assertTrue(hasattr(bpy.types.Scene, "patina"))
        self.assertTrue(hasattr(bpy.types, "PATINA_PT_main"))
        self.assertTrue(hasattr(bpy.types, "PATINA_PT_material"))
