# Run inside Blender: renders one view of a glTF file with Cycles, set up to compute what patina's path tracer computes.
#   blender -b --factory-startup -P cycles_view.py -- ASSET HDR OUT.exr SIZE SAMPLES FOV_DEGREES EX EY EZ TX TY TZ
# Eye and target are in glTF's axes (Y up); Blender's importer turns them into Z up. A second render with another seed, the scene already built,
# gives seconds and noise, printed as a line of JSON after "measured".
import json
import math
import os
import sys
import tempfile
import time

import bpy
import numpy
from mathutils import Matrix, Vector

asset, hdr, out, size, samples, fov, *coordinates = sys.argv[sys.argv.index("--") + 1 :]
size, samples, fov = int(size), int(samples), math.radians(float(fov))
values = [float(c) for c in coordinates]


numpy.bool = bool  # Debian's Blender 3.4 imports glTF with a name that Debian's numpy 1.24 has dropped


def z_up(v):
    return Vector((v[0], -v[2], v[1]))


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=asset)

scene = bpy.context.scene
for light in [o for o in scene.objects if o.type in ("LIGHT", "CAMERA")]:
    bpy.data.objects.remove(light)

# Camera: looks along its own -Z with +Y up, as in glTF.
eye, target = z_up(values[0:3]), z_up(values[3:6])
backward = (eye - target).normalized()
right = Vector((0, 0, 1)).cross(backward).normalized()
up = backward.cross(right)
data = bpy.data.cameras.new("camera")
data.sensor_fit = "VERTICAL"
data.angle_y = fov
data.clip_start, data.clip_end = 1e-4, 1e6
camera = bpy.data.objects.new("camera", data)
camera.matrix_world = Matrix((right, up, backward)).transposed().to_4x4()
camera.matrix_world.translation = eye
scene.collection.objects.link(camera)
scene.camera = camera

# World: the map as Blender shows it without any rotation.
world = bpy.data.worlds.new("world")
world.use_nodes = True
nodes, links = world.node_tree.nodes, world.node_tree.links
texture = nodes.new("ShaderNodeTexEnvironment")
texture.image = bpy.data.images.load(hdr)
texture.interpolation = "Linear"
links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
world.cycles.sampling_method = "MANUAL"
world.cycles.sample_map_resolution = 1024
scene.world = world

scene.render.engine = "CYCLES"
cycles = scene.cycles
cycles.device = "CPU"
cycles.samples = samples
cycles.use_adaptive_sampling = False
cycles.use_denoising = False
cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 8
cycles.transparent_max_bounces = 64
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0  # no clamping: patina has none
cycles.blur_glossy = 0.0
cycles.caustics_reflective = True
cycles.pixel_filter_type = "BOX"
cycles.filter_width = 1.0
scene.render.film_transparent = True
scene.render.resolution_x = scene.render.resolution_y = size
scene.render.resolution_percentage = 100
settings = scene.render.image_settings
settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
scene.view_settings.view_transform = "Raw"
scene.render.filepath = out
scene.render.use_persistent_data = True
bpy.ops.render.render(write_still=True)

cycles.seed = 1
with tempfile.TemporaryDirectory() as folder:
    scene.render.filepath = os.path.join(folder, "again.exr")
    begin = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - begin
    first, second = (numpy.array(bpy.data.images.load(path).pixels[:]).reshape(-1, 4) for path in (out, scene.render.filepath))
whole = numpy.minimum(first[:, 3], second[:, 3]) >= 1 - 1e-6
variance = ((first - second)[whole, :3] ** 2).mean() / 2
print("measured " + json.dumps({"seconds_of_cycles": seconds, "relative_noise_of_cycles": float(numpy.sqrt(variance) / first[whole, :3].mean())}))
