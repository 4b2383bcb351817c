# SPDX-License-Identifier: GPL-3.0-or-later
"""What feeds a socket of a material: a constant, or a picture that lies on UVs in a certain way.

In: Blender's node trees, which are only read. Out: Source. What a picture cannot stand for (noise
textures, mixes of several pictures) is a Source of kind "other", with its reason.
"""

from dataclasses import dataclass, field

import numpy

from .pixels import LUMINANCE, image_pixels

NAMES_OF_CHANNELS = {"R": 0, "Red": 0, "G": 1, "Green": 1, "B": 2, "Blue": 2}


@dataclass(frozen=True)
class Placement:
    """How a picture lies on the surface, in Blender's UVs (origin bottom left)."""

    layer: str = ""  # UV map; empty is the one that renders use
    offset: tuple = (0.0, 0.0)
    rotation: float = 0.0  # radians
    scale: tuple = (1.0, 1.0)
    extension: str = "REPEAT"


@dataclass
class Source:
    """`values()` of a picture: [H,W,C] f32, linear, top row first; C is 3, or 1 for a channel."""

    kind: str  # "constant", "picture" or "other"
    value: tuple = ()  # of a constant: 3 or 1 floats
    node: object = None  # of a picture: its image texture node
    channel: int = None  # 0 to 3; None takes the colour
    placement: Placement = Placement()
    steps: list = field(default_factory=list)  # functions of arrays, in order
    reason: str = ""

    def values(self):
        pixels = image_pixels(self.node.image)
        channel = self.channel
        values = pixels[..., :3] if channel is None else pixels[..., channel : channel + 1]
        for step in self.steps:
            values = step(values)
        return values


def principled_of(material):
    """The Principled BSDF that the material's output shows, also behind mixes; None without one."""
    if material is None or not material.use_nodes or material.node_tree is None:
        return None
    output = material.node_tree.get_output_node("ALL") or material.node_tree.get_output_node(
        "CYCLES"
    )
    waiting = [output.inputs["Surface"]] if output else []
    while waiting:
        socket = waiting.pop(0)
        for link in socket.links:
            if link.from_node.type == "BSDF_PRINCIPLED":
                return link.from_node
            waiting += [s for s in link.from_node.inputs if s.type == "SHADER"]
    return None


def origin(socket):
    """The output that is linked to the input, with reroutes skipped; None if nothing is."""
    while socket.is_linked and socket.links:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def _constant(socket):
    value = socket.default_value
    return tuple(float(v) for v in value[:3]) if hasattr(value, "__len__") else (float(value),)


def _placement(node):
    """Placement of an image texture node; None if its vector is not made of UVs."""
    if node.projection != "FLAT":
        return None
    offset, rotation, scale, layer = (0.0, 0.0), 0.0, (1.0, 1.0), ""
    output = origin(node.inputs["Vector"])
    if output is not None and output.node.type == "MAPPING":
        mapping = output.node
        inputs = [mapping.inputs[name] for name in ("Location", "Rotation", "Scale")]
        if mapping.vector_type not in {"POINT", "TEXTURE"} or any(s.is_linked for s in inputs):
            return None
        moved, turned, scaled = (tuple(s.default_value) for s in inputs)
        if mapping.vector_type == "TEXTURE" and (moved, turned, scaled) != (
            (0,) * 3,
            (0,) * 3,
            (1,) * 3,
        ):
            return None
        if turned[0] or turned[1]:
            return None
        offset, rotation, scale = moved[:2], turned[2], scaled[:2]
        output = origin(mapping.inputs["Vector"])
        if output is None:
            return None
    if output is not None:
        if output.node.type == "UVMAP":
            layer = output.node.uv_map
        elif not (output.node.type == "TEX_COORD" and output.name == "UV"):
            return None
    return Placement(layer, tuple(offset), rotation, tuple(scale), node.extension)


def _picture(output):
    node = output.node
    if node.image is None:
        return Source("other", reason="an image texture without an image")
    placement = _placement(node)
    if placement is None:
        return Source("other", reason=f"the coordinates of image '{node.image.name}' are not UVs")
    channel = 3 if output.name == "Alpha" else None
    return Source("picture", node=node, channel=channel, placement=placement)


def _separated(output):
    source = trace(output.node.inputs[0])
    channel = NAMES_OF_CHANNELS[output.name]
    if source.kind == "constant":
        return Source("constant", (source.value[channel],))
    if source.kind == "picture" and source.channel is None:
        if source.steps:
            source.steps = source.steps + [lambda v: v[..., channel : channel + 1]]
        else:
            source.channel = channel
    return source


def _product(a, b):
    """Of two sources, one of them constant; None otherwise."""
    if a.kind != "constant":
        a, b = b, a
    if a.kind != "constant":
        return None
    if b.kind == "constant":
        size = max(len(a.value), len(b.value))
        wide = [s.value * size if len(s.value) == 1 else s.value for s in (a, b)]
        return Source("constant", tuple(x * y for x, y in zip(*wide)))
    if b.kind == "picture":
        factor = a.value
        b.steps = b.steps + [lambda v: v * numpy.array(factor, numpy.float32)]
        return b
    return None


def _mixed(node):
    """A mix node that multiplies fully by a constant."""
    new_kind = node.type == "MIX"
    if new_kind and node.data_type != "RGBA":
        return None
    inputs = [s for s in node.inputs if s.enabled]
    factor, a, b = inputs[0], inputs[1], inputs[2]
    if node.blend_type != "MULTIPLY" or factor.is_linked or factor.default_value != 1.0:
        return None
    return _product(trace(a), trace(b))


def _inverted(node):
    factor, color = node.inputs[0], node.inputs[1]
    if factor.is_linked or factor.default_value != 1.0:
        return None
    source = trace(color)
    if source.kind == "constant":
        return Source("constant", tuple(1 - v for v in source.value))
    if source.kind == "picture":
        source.steps = source.steps + [lambda v: 1 - v]
    return source


def trace(socket):
    """The Source of an input socket."""
    output = origin(socket)
    if output is None:
        return Source("constant", _constant(socket))
    node, source = output.node, None
    if node.type == "TEX_IMAGE":
        return _picture(output)
    if node.type in {"RGB", "VALUE"}:
        return Source("constant", _constant(output))
    if node.type == "SEPRGB" or (node.type == "SEPARATE_COLOR" and node.mode == "RGB"):
        return _separated(output)
    if node.type in {"MIX", "MIX_RGB"}:
        source = _mixed(node)
    elif node.type == "MATH" and node.operation == "MULTIPLY" and not node.use_clamp:
        source = _product(trace(node.inputs[0]), trace(node.inputs[1]))
    elif node.type == "INVERT":
        source = _inverted(node)
    return source or Source("other", reason=f"it comes from the node '{node.name}'")


def _grey(values):
    return values if values.shape[-1] == 1 else (values @ LUMINANCE)[..., None]


def one_channel(source):
    """The source as a float socket sees it: of a colour, its luminance."""
    if source.kind == "constant" and len(source.value) == 3:
        return Source("constant", (float(sum(LUMINANCE * source.value)),))
    if source.kind == "picture" and source.channel is None:
        source.steps = source.steps + [_grey]
    return source


def normal_target(principled):
    """The socket that a normal map belongs into: the BSDF's, or the last bump node's above it."""
    socket = principled.inputs["Normal"]
    while True:
        output = origin(socket)
        if output is None or output.node.type != "BUMP":
            return socket
        socket = output.node.inputs["Normal"]


def normal_source(principled):
    """(Source, strength) of the normal map; a constant where there is none."""
    flat = Source("constant", (0.5, 0.5, 1.0))
    output = origin(normal_target(principled))
    if output is None:
        return flat, 1.0
    node = output.node
    if node.type != "NORMAL_MAP" or node.space != "TANGENT" or node.inputs["Strength"].is_linked:
        return Source("other", reason=f"it comes from the node '{node.name}'"), 1.0
    source = trace(node.inputs["Color"])
    if source.kind == "constant":
        return flat, 1.0
    return source, float(node.inputs["Strength"].default_value)
