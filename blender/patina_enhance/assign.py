# SPDX-License-Identifier: GPL-3.0-or-later
"""New maps in a material, and the way back.

For each map the material's node tree gets an image node of its own, linked to the socket that the
map belongs to. The old nodes stay. The material's property "patina" keeps, for each map, which
outputs are the old and the new one; Compare links one or the other.
"""

import os
import shutil

import bpy

from .job import safe_name
from .nodes import normal_target, origin, principled_of, trace

SOCKETS = {"base_color": "Base Color", "roughness": "Roughness", "metallic": "Metallic"}
PROPERTY = "patina"
SHOWS_NEW = "patina_shows_new"


def target_socket(material, map_name):
    principled = principled_of(material)
    if principled is None:
        return None
    return (
        normal_target(principled) if map_name == "normal" else principled.inputs[SOCKETS[map_name]]
    )


def _index(sockets, socket):
    return next(i for i, s in enumerate(sockets) if s == socket)


def _address(output):
    return [output.node.name, _index(output.node.outputs, output)] if output else []


def _old_picture(material, map_name):
    """The image node whose place on the surface the new map takes: the map's own, else that of the
    material's first texture, as patina chooses it."""
    own = target_socket(material, map_name)
    if map_name == "normal":
        above = origin(own)
        own = above.node.inputs["Color"] if above and above.node.type == "NORMAL_MAP" else None
    principled = principled_of(material)
    others = [principled.inputs[name] for name in ("Base Color", "Roughness", "Metallic")]
    for socket in [own, *others]:
        source = trace(socket) if socket else None
        if source and source.kind == "picture":
            return source, socket is own
    return None, False


def _place(material, node, map_name):
    """Lays the new image on the surface as the old one lies."""
    source, is_own = _old_picture(material, map_name)
    if source is None:
        return
    tree = material.node_tree
    if is_own:
        node.extension, node.interpolation = source.node.extension, source.node.interpolation
        vector = origin(source.node.inputs["Vector"])
        if vector:
            tree.links.new(vector, node.inputs["Vector"])
    elif source.placement.layer:
        uv = tree.nodes.new("ShaderNodeUVMap")
        uv.uv_map, uv.location = source.placement.layer, (node.location.x - 250, node.location.y)
        tree.links.new(uv.outputs["UV"], node.inputs["Vector"])


def load_map(material, map_name, file, folder):
    """A new image of the file, packed, or copied to `folder` where one is given."""
    name = f"{material.name} {map_name}"
    if folder:
        os.makedirs(folder, exist_ok=True)
        stem, number = f"{safe_name(material.name)}_{map_name}", 1
        while os.path.exists(path := os.path.join(folder, f"{stem}_{number:03d}.png")):
            number += 1
        shutil.copyfile(file, path)
        image = bpy.data.images.load(path)
        if bpy.data.filepath:
            image.filepath = bpy.path.relpath(path)
    else:
        image = bpy.data.images.load(file)
    image.name = name
    image.colorspace_settings.name = "sRGB" if map_name == "base_color" else "Non-Color"
    if not folder:
        image.pack()
        image.filepath = f"//{safe_name(name)}.png"
    return image


def assign_map(material, map_name, image):
    """Puts the image into the material. Throws LookupError if the Principled BSDF is gone."""
    socket = target_socket(material, map_name)
    if socket is None:
        raise LookupError(f"Material '{material.name}' has no Principled BSDF any more")
    tree, old = material.node_tree, origin(socket)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    node.label = f"patina {map_name.replace('_', ' ')}"
    place = socket.node.location
    node.location = (place.x - 650, place.y - 300 * [*SOCKETS, "normal"].index(map_name))
    _place(material, node, map_name)
    new = node.outputs["Color"]
    if map_name == "normal":
        normal = tree.nodes.new("ShaderNodeNormalMap")
        normal.location = (place.x - 300, node.location.y)
        tree.links.new(new, normal.inputs["Color"])
        new = normal.outputs["Normal"]
        layer = trace(normal.inputs["Color"]).placement.layer
        normal.uv_map = layer
    tree.links.new(new, socket)
    record = material.get(PROPERTY)
    record = record.to_dict() if record else {}
    target = [socket.node.name, _index(socket.node.inputs, socket)]
    record[map_name] = {
        "target": _text(target),
        "old": _text(_address(old)),
        "new": _text(_address(new)),
    }
    material[PROPERTY] = record


def _text(address):
    # An address as one text, because custom properties hold no lists of mixed types.
    return f"{address[1]} {address[0]}" if address else ""


def _socket(tree, text, side):
    """The socket at an address; None if its node is gone."""
    number, _, name = text.partition(" ")
    node = tree.nodes.get(name)
    sockets = getattr(node, side) if node else []
    return sockets[int(number)] if int(number) < len(sockets) else None


def has_record(material):
    return bool(material.get(PROPERTY))


def shows_new(material):
    return bool(material.get(SHOWS_NEW, True))


def show(material, new):
    """Links the new maps, or what was there before. Maps whose nodes were removed are left out."""
    tree = material.node_tree
    for entry in material[PROPERTY].to_dict().values():
        target = _socket(tree, entry["target"], "inputs")
        address = entry["new" if new else "old"]
        if target is None:
            continue
        if not address:
            for link in list(target.links):
                tree.links.remove(link)
        elif output := _socket(tree, address, "outputs"):
            tree.links.new(output, target)
    material[SHOWS_NEW] = new


def assign_results(fitted, folder):
    """Puts all maps [(material's name, map, file)] into their materials, in new images: packed, or
    in `folder` where one is given. Returns (changed materials, what could not be written)."""
    changed, faults = [], []
    wanted = {}
    for name, map_name, file in fitted:
        wanted.setdefault(name, []).append((map_name, file))
    for name, maps in wanted.items():
        material = bpy.data.materials.get(name)
        if material is None or principled_of(material) is None:
            faults.append(
                f"Material '{name}' was renamed or changed; its maps are {maps[0][1]} and others"
            )
            continue
        if has_record(material):  # what it shows now is the old one of the new record
            del material[PROPERTY]
        for map_name, file in maps:
            assign_map(material, map_name, load_map(material, map_name, file, folder))
        material[SHOWS_NEW] = True
        changed.append(material)
    return changed, faults
