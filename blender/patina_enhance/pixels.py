# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of Blender's images as linear values, and linear values as eight bits.

Works on what Blender holds in memory, so packed, unpacked, painted and generated images are alike.
"""

import numpy

LUMINANCE = numpy.array([0.2126, 0.7152, 0.0722], numpy.float32)


class UnreadableImage(Exception):
    """An image that cannot be exported; the text names it and says why."""


def linear_from_srgb(values):
    return numpy.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(values):
    values = numpy.clip(values, 0.0, 1.0)
    return numpy.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)


def eight_bits(values):
    """values [...] f32, 0 to 1 → uint8."""
    return numpy.rint(numpy.clip(values, 0.0, 1.0) * 255).astype(numpy.uint8)


def image_pixels(image):
    """[H,W,4] f32, top row first, colours linear Rec. 709. Throws UnreadableImage."""
    if image.source in {"TILED", "MOVIE", "SEQUENCE"}:
        kind = {"TILED": "UDIM tiles", "MOVIE": "a movie", "SEQUENCE": "a sequence"}[image.source]
        raise UnreadableImage(f"Image '{image.name}' is {kind}, which patina does not read")
    width, height = image.size
    if width == 0 or height == 0 or len(image.pixels) != width * height * image.channels:
        raise UnreadableImage(f"Image '{image.name}' has no pixels: is its file missing?")
    flat = numpy.empty(width * height * image.channels, numpy.float32)
    image.pixels.foreach_get(flat)
    stored = flat.reshape(height, width, image.channels)[::-1]
    pixels = numpy.ones((height, width, 4), numpy.float32)
    pixels[..., : image.channels] = stored
    if image.channels == 1:
        pixels[..., 1:3] = stored
    space = image.colorspace_settings
    is_linear = (
        space.is_data or space.name in {"Non-Color", "Raw"} or space.name.startswith("Linear")
    )
    if not image.is_float and not is_linear:
        table = linear_from_srgb(numpy.arange(256) / 255).astype(numpy.float32)
        pixels[..., :3] = table[eight_bits(pixels[..., :3])]
    return pixels


def resized(values, width, height):
    """values [H,W,C] → [height,width,C], each pixel the nearest of the old ones."""
    rows = numpy.arange(height) * values.shape[0] // height
    columns = numpy.arange(width) * values.shape[1] // width
    return values[rows][:, columns]
