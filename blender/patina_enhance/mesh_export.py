# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects as they render, modifiers applied, as arrays in glTF's axes."""

from contextlib import contextmanager

import numpy

# World of Blender (+Z up) → world of glTF (+Y up).
GLTF_FROM_BLENDER = numpy.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)


@contextmanager
def modifiers_as_rendered(objects):
    """Shows modifiers in the viewport as renders would apply them, and puts them back at the end.
    Blender evaluates objects for the viewport only, unless a render engine asks."""
    saved = []

    def change(item, name, value):
        if getattr(item, name) != value:
            saved.append((item, name, getattr(item, name)))
            setattr(item, name, value)

    try:
        for obj in objects:
            for modifier in obj.modifiers:
                change(modifier, "show_viewport", modifier.show_render)
                if modifier.type in {"SUBSURF", "MULTIRES"}:
                    change(modifier, "levels", modifier.render_levels)
        yield
    finally:
        for item, name, value in reversed(saved):
            setattr(item, name, value)


def _normals(mesh):
    """[L,3] of each corner."""
    normals = numpy.empty(3 * len(mesh.loops), numpy.float32)
    if hasattr(mesh, "corner_normals"):
        mesh.corner_normals.foreach_get("vector", normals)
    else:  # before Blender 4.1
        mesh.calc_normals_split()
        mesh.loops.foreach_get("normal", normals)
    return normals.reshape(-1, 3)


def _array(items, name, size, dtype):
    values = numpy.empty(len(items) * size, dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, size) if size > 1 else values


def active_render_layer(mesh):
    """The UV map that renders use; None without one."""
    layers = mesh.uv_layers
    return next((layer for layer in layers if layer.active_render), layers[0] if layers else None)


class ExportedMesh:
    """Corners of an evaluated mesh: positions [L,3] f64 in metres and normals [L,3], both in glTF's
    world; triangles [T,3] of corners; material slot of each triangle [T]."""

    def __init__(self, evaluated, mesh, metres):
        mesh.calc_loop_triangles()
        world = numpy.array(evaluated.matrix_world, float)
        linear, moved = world[:3, :3], world[:3, 3]
        vertices = _array(mesh.vertices, "co", 3, numpy.float32).astype(float)
        corners = _array(mesh.loops, "vertex_index", 1, numpy.int32)
        p_world = (vertices @ linear.T + moved) * metres
        self.positions = (p_world @ GLTF_FROM_BLENDER.T)[corners]
        # The cofactors turn normals as the inverse transpose does, also where the matrix is flat.
        cofactors = numpy.array(
            [numpy.cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)]
        )
        is_mirrored = numpy.linalg.det(linear) < 0
        normals = _normals(mesh) @ (cofactors.T @ GLTF_FROM_BLENDER.T) * (-1 if is_mirrored else 1)
        length = numpy.linalg.norm(normals, axis=1, keepdims=True)
        self.normals = normals / numpy.where(length > 0, length, 1)
        self.triangles = _array(mesh.loop_triangles, "loops", 3, numpy.int32)
        if is_mirrored:
            self.triangles = self.triangles[:, ::-1]
        self.slots = _array(mesh.loop_triangles, "material_index", 1, numpy.int32)
        self.layers = {layer.name: self._uv(layer) for layer in mesh.uv_layers}
        first = active_render_layer(mesh)
        self.first_layer = first.name if first else None

    @staticmethod
    def _uv(layer):
        uv = _array(layer.data, "uv", 2, numpy.float32)
        return numpy.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def welded(attributes, triangles):
    """Corners that are alike in all attributes become one vertex.

    attributes: arrays [L,*] f32; triangles [T,3] → (attributes of the vertices, indices [3T])."""
    used, local = numpy.unique(triangles.ravel(), return_inverse=True)
    rows = numpy.ascontiguousarray(
        numpy.concatenate([a[used] for a in attributes], axis=1), numpy.float32
    )
    keys = rows.view(numpy.dtype((numpy.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, first, vertex_of = numpy.unique(keys, return_index=True, return_inverse=True)
    return [a[used][first] for a in attributes], vertex_of[local]
