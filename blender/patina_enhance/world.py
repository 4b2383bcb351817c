# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's world as an equirectangular picture, rendered by Cycles: so skies, rotations and
mixes are in it as they are."""

import math
import os

import bpy

WIDTH, HEIGHT, SAMPLES = 512, 256, 4


def save_world(world, path):
    """Writes an .exr at `path`, in patina's orientation: its centre looks along +X."""
    scene = bpy.data.scenes.new("patina world")
    camera = bpy.data.cameras.new("patina world")
    eye = bpy.data.objects.new("patina world", camera)
    try:
        scene.collection.objects.link(eye)
        scene.camera, scene.world = eye, world
        eye.rotation_euler = (math.radians(90), 0, math.radians(-90))
        camera.type = "PANO"
        (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = (
            "EQUIRECTANGULAR"
        )
        render = scene.render
        render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples = "CPU", SAMPLES
        scene.cycles.use_denoising = False
        render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
        settings = render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
        scene.view_settings.view_transform = "Raw"
        render.filepath = os.path.splitext(path)[0]
        render.use_file_extension = True
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(eye)
        bpy.data.cameras.remove(camera)
