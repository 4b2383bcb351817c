# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether meshes have UVs, and Smart UV Project for those that have none."""

import math

import bpy
import numpy

from .mesh_export import active_render_layer

ISLAND_MARGIN = 0.02  # of the texture's width


def has_usable_uvs(mesh):
    """False without a UV map, or with one whose corners lie all on one line or point."""
    layer = active_render_layer(mesh)
    if layer is None or not len(layer.data):
        return False
    uv = numpy.empty(2 * len(layer.data), numpy.float32)
    layer.data.foreach_get("uv", uv)
    return bool((numpy.ptp(uv.reshape(-1, 2), axis=0) > 1e-6).all())


def meshes_without_uvs(objects):
    return [obj for obj in objects if len(obj.data.polygons) and not has_usable_uvs(obj.data)]


def smart_project(context, objects):
    """Unwraps the meshes of the objects. Selection, active object and mode stay as they were."""
    selected, active = list(context.selected_objects), context.view_layer.objects.active
    bpy.ops.object.select_all(action="DESELECT")
    for obj in objects:
        obj.select_set(True)
    context.view_layer.objects.active = objects[0]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=math.radians(66), island_margin=ISLAND_MARGIN)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.select_all(action="DESELECT")
    for obj in selected:
        obj.select_set(True)
    context.view_layer.objects.active = active
