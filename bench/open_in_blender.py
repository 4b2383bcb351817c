"""Opens assets in Blender and tells whether every material has its textures in place; optionally renders a picture.

    blender -b --factory-startup --python bench/open_in_blender.py -- rusty.glb [more.glb ...] [--picture out.png]

Ends with exit code 1 if an asset does not open or an image has no pixels. Needs Blender (scripts/setup.sh --bench).
"""

import math
import sys

import bpy
import mathutils
import numpy

numpy.bool = bool  # Debian's Blender 3.4 asks for a name that Debian's numpy 1.24 no longer has


def open_asset(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)


def describe_materials():
    """One line a material: which inputs of its shader are fed by which image. Returns the number of images without pixels."""
    broken = 0
    for material in bpy.data.materials:
        if not material.use_nodes:
            continue
        images = [n.image for n in material.node_tree.nodes if n.type == "TEX_IMAGE" and n.image]
        for image in images:
            if image.size[0] == 0 or not image.has_data and not image.pixels[:4]:
                broken += 1
        print(f"  {material.name}: " + ", ".join(f"{i.name} {i.size[0]}x{i.size[1]}" for i in images))
    return broken


def render_picture(path):
    corners = [o.matrix_world @ mathutils.Vector(c) for o in bpy.data.objects if o.type == "MESH" for c in o.bound_box]
    low = mathutils.Vector([min(c[i] for c in corners) for i in range(3)])
    high = mathutils.Vector([max(c[i] for c in corners) for i in range(3)])
    center, radius = (low + high) / 2, (high - low).length / 2
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = math.radians(35)
    camera.data.clip_start, camera.data.clip_end = radius / 100, radius * 100
    camera.location = center + mathutils.Vector((1.2, -2.6, 1.0)).normalized() * radius / math.sin(math.radians(17.5))
    camera.rotation_euler = (center - camera.location).to_track_quat("-Z", "Y").to_euler()
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.9, 0.9, 0.9, 1)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 2.5
    sun.rotation_euler = (0.7, 0.2, 0.6)
    scene.collection.objects.link(sun)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 32, False
    scene.render.resolution_x = scene.render.resolution_y = 512
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def main():
    arguments = sys.argv[sys.argv.index("--") + 1 :]
    picture = arguments[arguments.index("--picture") + 1] if "--picture" in arguments else None
    assets = [a for a in arguments if a.endswith((".glb", ".gltf", ".obj"))]
    broken = 0
    for path in assets:
        print(path)
        open_asset(path)
        broken += describe_materials()
        if picture:
            render_picture(picture)
    print(f"{len(assets)} assets opened, {broken} images without pixels")
    sys.exit(1 if broken else 0)


main()
