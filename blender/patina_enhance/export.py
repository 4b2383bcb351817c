# SPDX-License-Identifier: GPL-3.0-or-later
"""The chosen objects as a .glb file for patina. Materials keep their order, so that results find
their way back."""

from dataclasses import dataclass, field

import numpy

from .glb import Glb
from .material_export import MaterialExport, textured_layers
from .mesh_export import ExportedMesh, modifiers_as_rendered, welded
from .nodes import principled_of
from .uvs import meshes_without_uvs


class ExportError(Exception):
    """Something that must be mended first; the text says what and how."""


class NoUvs(ExportError):
    """Some meshes have no UVs; Smart UV Project would make them."""


@dataclass
class Exported:
    data: bytes  # the .glb file
    materials: list  # names, in the order of the file
    warnings: list = field(default_factory=list)


def chosen_objects(context):
    """The selected meshes that renders show."""
    return [o for o in context.selected_objects if o.type == "MESH" and not o.hide_render]


def materials_of(objects):
    """Their materials, each once, in the order of objects and slots."""
    slots = [slot for obj in objects for slot in obj.material_slots]
    return list(dict.fromkeys(slot.material for slot in slots if slot.material))


def enhanceable(material):
    """'' if patina can change the material, else why not."""
    if material.library or (material.node_tree and material.node_tree.library):
        return "is linked from another file; make it local first"
    if principled_of(material) is None:
        return "has no Principled BSDF at its output"
    return ""


def _check(objects, wanted):
    if not objects:
        raise ExportError("No mesh is selected. Select the objects that patina shall work on")
    for obj in objects:
        if not any(slot.material for slot in obj.material_slots):
            raise ExportError(f"Object '{obj.name}' has no material. Give it one first")
    for material in wanted:
        if fault := enhanceable(material):
            raise ExportError(f"Material '{material.name}' {fault}")
    if not wanted:
        raise ExportError("No material is chosen. Tick one in the list of materials")
    if without := meshes_without_uvs(objects):
        names = ", ".join(f"'{obj.name}'" for obj in without)
        raise NoUvs(f"No UVs: {names}. Unwrap them first, for example with Smart UV Project")


def export_objects(context, objects, wanted):
    """The objects with modifiers applied for rendering; `wanted` are the materials that may change.
    Returns Exported. Throws ExportError before anything is changed."""
    _check(objects, wanted)
    materials = [m for m in materials_of(objects) if principled_of(m)]
    layers = sorted(set().union(*(textured_layers(m) for m in materials)))
    uv_sets = {"": 0, **{layer: i + 1 for i, layer in enumerate(layers)}}
    glb = Glb()
    writer = MaterialExport(glb)
    index_of = {m.name: writer.add(m, uv_sets) for m in materials}
    grey = None
    metres = context.scene.unit_settings.scale_length or 1.0
    meshes = []
    with modifiers_as_rendered(objects):
        context.view_layer.update()
        depsgraph = context.evaluated_depsgraph_get()
        for obj in objects:
            evaluated = obj.evaluated_get(depsgraph)
            mesh = evaluated.to_mesh()
            try:
                names = [
                    slot.material.name if slot.material else None
                    for slot in evaluated.material_slots
                ]
                meshes.append((obj.name, ExportedMesh(evaluated, mesh, metres), names))
            finally:
                evaluated.to_mesh_clear()
    context.view_layer.update()
    corners = [m.positions for _, m, _ in meshes if len(m.triangles)]
    if not corners:
        raise ExportError("The selected objects have no faces")
    everything = numpy.concatenate(corners)
    centre = (everything.min(axis=0) + everything.max(axis=0)) / 2
    for name, mesh, names in meshes:
        primitives = []
        for slot in numpy.unique(mesh.slots):
            material = names[min(slot, len(names) - 1)]
            if material not in index_of and grey is None:
                grey = glb.material({"name": "other", "doubleSided": True})
            index = index_of.get(material, grey)
            primitives.append(
                _primitive(glb, mesh, mesh.triangles[mesh.slots == slot], centre, layers, index)
            )
        if primitives:
            glb.mesh(name, primitives, centre)
    return Exported(glb.to_bytes(), [m.name for m in materials], writer.warnings)


def _primitive(glb, mesh, triangles, centre, layers, material):
    attributes = [mesh.positions - centre, mesh.normals]
    names = ["POSITION", "NORMAL"]
    none = numpy.zeros((len(mesh.positions), 2), numpy.float32)
    if mesh.first_layer:
        for number, layer in enumerate([mesh.first_layer, *layers]):
            attributes.append(mesh.layers.get(layer, none))
            names.append(f"TEXCOORD_{number}")
    values, indices = welded(attributes, triangles)
    return {
        "attributes": {
            n: glb.attribute(v, with_bounds=n == "POSITION") for n, v in zip(names, values)
        },
        "indices": glb.indices(indices),
        "material": material,
    }
