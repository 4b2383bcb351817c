# SPDX-License-Identifier: GPL-3.0-or-later
"""One of Blender's materials as a glTF material: what patina's views show of it."""

import math

import numpy

from .nodes import Source, normal_source, one_channel, principled_of, trace
from .pixels import UnreadableImage, eight_bits, resized, srgb_from_linear
from .png import png_bytes


class MaterialExport:
    """Writes materials into a Glb. `warnings` says what the views will not show as it is."""

    def __init__(self, glb):
        self._glb = glb
        self.warnings = []

    def add(self, material, uv_sets):
        """uv_sets: UV maps that textures name → number of the set. Returns the glTF index."""
        principled = principled_of(material)
        out = {"name": material.name, "doubleSided": not material.use_backface_culling}
        pbr = out["pbrMetallicRoughness"] = {}
        self._base_color(material, principled, uv_sets, out, pbr)
        self._metallic_roughness(material, principled, uv_sets, pbr)
        self._normal(material, principled, uv_sets, out)
        self._emission(material, principled, uv_sets, out)
        return self._glb.material(out)

    def _known(self, source, what, material, stand_in):
        """The source, or a constant with a warning where a picture cannot stand for it."""
        if source.kind == "picture":
            try:
                source.values()
            except UnreadableImage as fault:
                source = Source("other", reason=str(fault))
        if source.kind != "other":
            return source
        self.warnings.append(
            f"Material '{material.name}', {what}: {source.reason}. "
            "The views show a plain value there"
        )
        return Source("constant", stand_in)

    def _reference(self, pixels, placement, uv_sets):
        texture = self._glb.texture(png_bytes(pixels), placement.extension)
        reference = {"index": texture, "texCoord": uv_sets.get(placement.layer, 0)}
        if placement.offset != (0, 0) or placement.rotation or placement.scale != (1, 1):
            reference["extensions"] = {"KHR_texture_transform": texture_transform(placement)}
            self._glb.use_extension("KHR_texture_transform")
        return reference

    def _base_color(self, material, principled, uv_sets, out, pbr):
        stand_in = tuple(material.diffuse_color[:3])
        color = self._known(
            trace(principled.inputs["Base Color"]), "base colour", material, stand_in
        )
        alpha = one_channel(trace(principled.inputs["Alpha"]))
        if color.kind == "constant":
            value = color.value if len(color.value) == 3 else color.value * 3
            opacity = alpha.value[0] if alpha.kind == "constant" else 1.0
            pbr["baseColorFactor"] = [min(max(v, 0.0), 1.0) for v in (*value, opacity)]
        else:
            pixels = eight_bits(srgb_from_linear(_rgb(color.values())))
            if alpha.kind == "picture" and alpha.node.image == color.node.image:
                pixels = numpy.concatenate([pixels, eight_bits(alpha.values())], axis=-1)
            pbr["baseColorTexture"] = self._reference(pixels, color.placement, uv_sets)
            if alpha.kind == "constant":
                pbr["baseColorFactor"] = [1, 1, 1, min(max(alpha.value[0], 0.0), 1.0)]
        if alpha.kind != "constant" or alpha.value[0] < 1:
            is_cut = getattr(material, "blend_method", "BLEND") == "CLIP"
            out["alphaMode"] = "MASK" if is_cut else "BLEND"
            if is_cut:
                out["alphaCutoff"] = material.alpha_threshold

    def _metallic_roughness(self, material, principled, uv_sets, pbr):
        sources = {
            name: self._known(
                one_channel(trace(principled.inputs[socket])), name, material, (stand_in,)
            )
            for name, socket, stand_in in (
                ("roughness", "Roughness", 0.5),
                ("metallic", "Metallic", 0.0),
            )
        }
        pictures = [source for source in sources.values() if source.kind == "picture"]
        if len(pictures) == 2 and pictures[0].placement != pictures[1].placement:
            self.warnings.append(
                f"Material '{material.name}': its metallic picture lies otherwise than that of its "
                "roughness. The views show its mean"
            )
            mean = float(pictures[1].values().mean())
            sources["metallic"], pictures = Source("constant", (mean,)), pictures[:1]
        for name, source in sources.items():
            is_constant = source.kind == "constant"
            pbr[name + "Factor"] = min(max(source.value[0], 0.0), 1.0) if is_constant else 1.0
        if pictures:
            values = {name: s.values() for name, s in sources.items() if s.kind == "picture"}
            height = max(v.shape[0] for v in values.values())
            width = max(v.shape[1] for v in values.values())
            packed = numpy.full((height, width, 3), 255, numpy.uint8)
            for channel, name in ((1, "roughness"), (2, "metallic")):
                if name in values:
                    packed[..., channel] = eight_bits(resized(values[name], width, height))[..., 0]
            pbr["metallicRoughnessTexture"] = self._reference(
                packed, pictures[0].placement, uv_sets
            )

    def _normal(self, material, principled, uv_sets, out):
        source, strength = normal_source(principled)
        source = self._known(source, "normal", material, (0.5, 0.5, 1.0))
        if source.kind == "picture":
            reference = self._reference(
                eight_bits(_rgb(source.values())), source.placement, uv_sets
            )
            out["normalTexture"] = dict(reference, scale=strength)

    def _emission(self, material, principled, uv_sets, out):
        inputs = principled.inputs
        socket = inputs["Emission Color"] if "Emission Color" in inputs else inputs["Emission"]
        strength = trace(inputs["Emission Strength"])
        amount = strength.value[0] if strength.kind == "constant" else 1.0
        source = trace(socket)
        if amount <= 0 or (source.kind == "constant" and max(source.value) <= 0):
            return
        source = self._known(source, "emission", material, (0.0, 0.0, 0.0))
        color = (1.0, 1.0, 1.0)
        if source.kind == "picture":
            pixels = eight_bits(srgb_from_linear(_rgb(source.values())))
            out["emissiveTexture"] = self._reference(pixels, source.placement, uv_sets)
        else:
            color = source.value if len(source.value) == 3 else source.value * 3
        peak = max(1.0, amount * max(color))
        out["emissiveFactor"] = [amount * v / peak for v in color]
        if peak > 1:
            out["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": peak}}
            self._glb.use_extension("KHR_materials_emissive_strength")


def _rgb(values):
    return values if values.shape[-1] == 3 else numpy.repeat(values, 3, axis=-1)


def texture_transform(placement):
    """Placement in Blender's UVs (origin bottom left) → KHR_texture_transform (origin top left)."""
    (x, y), r, (_, scale_y) = placement.offset, placement.rotation, placement.scale
    return {
        "offset": [x - scale_y * math.sin(r), 1 - y - scale_y * math.cos(r)],
        "rotation": r,
        "scale": list(placement.scale),
    }


def textured_layers(material):
    """UV maps that the textures of the material name, without the one that renders use."""
    principled = principled_of(material)
    sockets = ("Base Color", "Roughness", "Metallic")
    sources = [trace(principled.inputs[s]) for s in sockets] + [normal_source(principled)[0]]
    return {s.placement.layer for s in sources if s.kind == "picture"} - {""}
