# SPDX-License-Identifier: GPL-3.0-or-later
"""What the exported file holds: shapes, units, materials, light."""

import json
import math
import struct
import subprocess

import bpy
import numpy
import support
from patina_enhance import export, material_export, nodes, pixels, world
from support import BlenderTest, cube, material, noise, picture, principled, select


def parsed(data):
    """(JSON, binary) of a .glb file's bytes."""
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), data[20 + size + 8 :]


def accessor(document, binary, index, dtype=numpy.float32):
    item = document["accessors"][index]
    view = document["bufferViews"][item["bufferView"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[item["type"]]
    return numpy.frombuffer(binary, dtype, item["count"] * width, view["byteOffset"]).reshape(
        -1, width
    )


def texture(document, binary, reference, folder):
    """Pixels [H,W,4] 0 to 255, as stored, top row first."""
    image = document["images"][document["textures"][reference["index"]]["source"]]
    view = document["bufferViews"][image["bufferView"]]
    path = folder / "texture.png"
    path.write_bytes(binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]])
    loaded = bpy.data.images.load(str(path))
    width, height = loaded.size
    values = numpy.array(loaded.pixels[:]).reshape(height, width, 4)[::-1]
    bpy.data.images.remove(loaded)
    return numpy.rint(255 * values).astype(int)


class ExportTest(BlenderTest):
    def export(self, *objects):
        select(*objects)
        wanted = export.materials_of(objects)
        self.exported = export.export_objects(bpy.context, list(objects), wanted)
        return parsed(self.exported.data)

    def positions(self, document, binary, mesh=0):
        node = next(n for n in document["nodes"] if n["mesh"] == mesh)
        index = document["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]
        return accessor(document, binary, index) + node["translation"]

    def triangles(self, document):
        return sum(
            document["accessors"][p["indices"]]["count"] // 3
            for mesh in document["meshes"]
            for p in mesh["primitives"]
        )


class Shapes(ExportTest):
    def test_transforms_and_units_end_in_metres_with_y_up(self):
        box = cube(materials=[material("m")])
        box.scale, box.location = (1, 2, 3), (10, 20, 30)
        bpy.context.scene.unit_settings.scale_length = 0.01
        p = self.positions(*self.export(box))
        numpy.testing.assert_allclose(p.min(axis=0), [0.095, 0.285, -0.21], atol=1e-6)
        numpy.testing.assert_allclose(p.max(axis=0), [0.105, 0.315, -0.19], atol=1e-6)

    def test_mirrored_objects_keep_their_outside_outside(self):
        box = cube(materials=[material("m")])
        box.scale, box.rotation_euler = (-1, 1, 2), (0.3, 0.2, 0.1)
        document, binary = self.export(box)
        primitive = document["meshes"][0]["primitives"][0]
        p = accessor(document, binary, primitive["attributes"]["POSITION"])
        n = accessor(document, binary, primitive["attributes"]["NORMAL"])
        t = accessor(document, binary, primitive["indices"], numpy.uint32).reshape(-1, 3)
        outward = numpy.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]])
        centre = p.mean(axis=0)
        self.assertTrue((numpy.sum(outward * (p[t[:, 0]] - centre), axis=1) > 0).all())
        self.assertTrue((numpy.sum(outward * n[t[:, 0]], axis=1) > 0).all())

    def test_objects_far_away_keep_their_precision(self):
        box = cube(materials=[material("m")], size=0.001)
        box.location = (100000, 0, 0)
        document, binary = self.export(box)
        p = accessor(
            document, binary, document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        )
        numpy.testing.assert_allclose(numpy.ptp(p, axis=0), 0.001, rtol=1e-4)

    def test_modifiers_are_applied_as_renders_do_and_left_as_they_were(self):
        box = cube(materials=[material("m")])
        smooth = box.modifiers.new("smooth", "SUBSURF")
        smooth.levels, smooth.render_levels, smooth.show_viewport = 0, 2, False
        hidden = box.modifiers.new("hidden", "ARRAY")
        hidden.show_render = False
        document, _ = self.export(box)
        self.assertEqual(self.triangles(document), 6 * 16 * 2)
        self.assertEqual(
            (smooth.levels, smooth.show_viewport, hidden.show_viewport), (0, False, True)
        )
        self.assertEqual(len(box.data.polygons), 6)

    def test_objects_and_materials_keep_apart(self):
        red, blue = material("red"), material("blue")
        one, two = cube("one", [red, blue]), cube("two", [blue])
        for polygon in list(one.data.polygons)[:2]:
            polygon.material_index = 1
        document, _ = self.export(one, two)
        self.assertEqual(self.exported.materials, ["red", "blue"])
        counts = [
            [(p["material"], document["accessors"][p["indices"]]["count"]) for p in m["primitives"]]
            for m in document["meshes"]
        ]
        self.assertEqual(counts, [[(0, 24), (1, 12)], [(1, 36)]])


class Materials(ExportTest):
    def material_of(self, made):
        self.document, self.binary = self.export(cube(materials=[made]))
        return self.document["materials"][0]

    def pixels_of(self, reference):
        return texture(self.document, self.binary, reference, self.folder)

    def test_base_color_keeps_its_bytes(self):
        values = noise()
        for packed in (True, False):
            made = self.material_of(material("m", picture("colours", values, packed)))
            stored = self.pixels_of(made["pbrMetallicRoughness"]["baseColorTexture"])
            numpy.testing.assert_array_equal(stored[..., :3], numpy.rint(255 * values[::-1]))

    def test_constants_multiply_pictures(self):
        made = material("m", picture("grey", numpy.full((4, 4, 3), 1.0)))
        tree, socket = made.node_tree, principled(made).inputs["Base Color"]
        mix = tree.nodes.new("ShaderNodeMixRGB")
        mix.blend_type = "MULTIPLY"
        mix.inputs[0].default_value, mix.inputs[2].default_value = 1.0, (0.5, 0.25, 0.0, 1.0)
        tree.links.new(socket.links[0].from_socket, mix.inputs[1])
        tree.links.new(mix.outputs[0], socket)
        reference = self.material_of(made)["pbrMetallicRoughness"]["baseColorTexture"]
        wanted = numpy.rint(255 * pixels.srgb_from_linear(numpy.array([0.5, 0.25, 0.0])))
        numpy.testing.assert_array_equal(self.pixels_of(reference)[0, 0, :3], wanted)

    def test_roughness_and_metallic_of_two_pictures_are_packed(self):
        made = material("m")
        for name, value, size in (("Roughness", 0.25, 8), ("Metallic", 0.75, 4)):
            node = made.node_tree.nodes.new("ShaderNodeTexImage")
            node.image = picture(name, numpy.full((size, size, 3), value), is_data=True)
            made.node_tree.links.new(node.outputs["Color"], principled(made).inputs[name])
        reference = self.material_of(made)["pbrMetallicRoughness"]["metallicRoughnessTexture"]
        stored = self.pixels_of(reference)
        self.assertEqual(stored.shape, (8, 8, 4))
        self.assertEqual(stored[0, 0, 1:3].tolist(), [64, 191])

    def test_what_no_picture_stands_for_is_named(self):
        made = material("mossy")
        node = made.node_tree.nodes.new("ShaderNodeTexNoise")
        made.node_tree.links.new(node.outputs["Color"], principled(made).inputs["Base Color"])
        self.material_of(made)
        self.assertEqual(len(self.exported.warnings), 1)
        self.assertIn("'mossy', base colour", self.exported.warnings[0])

    def test_uv_maps_that_textures_name_become_sets(self):
        made = material("m", picture("colours", noise()))
        image_node = support.source_node(principled(made).inputs["Base Color"])
        uv = made.node_tree.nodes.new("ShaderNodeUVMap")
        uv.uv_map = "second"
        made.node_tree.links.new(uv.outputs["UV"], image_node.inputs["Vector"])
        box = cube(materials=[made])
        layer = box.data.uv_layers.new(name="second")
        for corner in layer.data:
            corner.uv = (0.25, 0.5) if corner.uv[0] > 0.5 else (0.75, 0.125)
        document, binary = self.export(box)
        reference = document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        attributes = document["meshes"][0]["primitives"][0]["attributes"]
        stored = accessor(document, binary, attributes[f"TEXCOORD_{reference['texCoord']}"])
        self.assertEqual(sorted(set(map(tuple, stored.tolist()))), [(0.25, 0.5), (0.75, 0.875)])

    def test_mapping_becomes_the_same_texture_transform(self):
        placement = nodes.Placement(offset=(0.1, 0.2), rotation=0.7, scale=(2.0, 3.0))
        transform = material_export.texture_transform(placement)
        u, v, r = 0.3, 0.6, transform["rotation"]
        x, y = u * transform["scale"][0], v * transform["scale"][1]
        moved = (
            transform["offset"][0] + math.cos(r) * x + math.sin(r) * y,
            transform["offset"][1] - math.sin(r) * x + math.cos(r) * y,
        )
        bx, by = u * 2.0, (1 - v) * 3.0  # what the Mapping node does, in Blender's UVs
        wanted = (
            math.cos(0.7) * bx - math.sin(0.7) * by + 0.1,
            math.sin(0.7) * bx + math.cos(0.7) * by + 0.2,
        )
        numpy.testing.assert_allclose(moved, (wanted[0], 1 - wanted[1]), atol=1e-12)


class Light(BlenderTest):
    def test_the_world_arrives_as_it_is(self):
        values = numpy.full((16, 32, 4), 0.25, numpy.float32)
        values[12:, 20:28] = (4.0, 2.0, 1.0, 1.0)  # a lamp, above and right of the centre
        sky = bpy.data.images.new("sky", 32, 16, float_buffer=True)
        sky.pixels.foreach_set(values.ravel())
        made = bpy.data.worlds.new("world")
        made.use_nodes = True
        node = made.node_tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = sky
        made.node_tree.links.new(
            node.outputs["Color"], made.node_tree.nodes["Background"].inputs["Color"]
        )
        path = self.folder / "world.exr"
        scenes = len(bpy.data.scenes)
        world.save_world(made, str(path))
        self.assertEqual(len(bpy.data.scenes), scenes)
        image = bpy.data.images.load(str(path))
        width, height = image.size
        stored = numpy.array(image.pixels[:]).reshape(height, width, -1)
        numpy.testing.assert_allclose(
            stored[height * 14 // 16, width * 24 // 32, :3], (4, 2, 1), rtol=0.02
        )
        numpy.testing.assert_allclose(
            stored[height * 14 // 16, width * 4 // 32, :3], 0.25, rtol=0.02
        )
        numpy.testing.assert_allclose(
            stored[height * 4 // 16, width * 24 // 32, :3], 0.25, rtol=0.02
        )


class Views(BlenderTest):
    def views(self, asset, name):
        run = self.folder / name
        subprocess.run(
            [
                support.PROGRAM,
                "render",
                asset,
                "--run",
                run,
                "--views=4",
                "--resolution=128",
                "--samples=64",
                "-q",
            ],
            check=True,
        )
        sheet = []
        for file in sorted((run / "views").glob("tile_*.png")):
            image = bpy.data.images.load(str(file))
            sheet.append(numpy.array(image.pixels[:]))
        return numpy.array(sheet)

    def test_an_imported_asset_looks_as_its_own_file(self):
        kettle = support.ROOT / "examples" / "kettle.glb"
        objects = support.import_gltf(kettle)
        exported = export.export_objects(bpy.context, objects, export.materials_of(objects))
        self.assertEqual(exported.warnings, [])
        (self.folder / "again.glb").write_bytes(exported.data)
        before, after = self.views(kettle, "before"), self.views(self.folder / "again.glb", "after")
        self.assertGreater(before.std(), 0.1, "the views show nothing")
        self.assertLess(numpy.abs(before - after).mean(), 0.01)
