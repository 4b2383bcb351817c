# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a running job: the edited views side by side, and how far the fit has come.

They are put into the image "patina preview", which image editors show and the panel as well.
"""

import base64
import math
import os
import re

import bpy
import numpy

NAME = "patina preview"
ICON_SIZE = 256  # pixels, at most


def contact_sheet(pictures):
    """Arrays [H,W,4] of one size, top row first → one array, row after row, about square."""
    columns = math.ceil(math.sqrt(len(pictures)))
    height, width = pictures[0].shape[:2]
    rows = math.ceil(len(pictures) / columns)
    sheet = numpy.zeros((rows * height, columns * width, 4), numpy.float32)
    for i, picture in enumerate(pictures):
        y, x = i // columns * height, i % columns * width
        sheet[y : y + height, x : x + width] = picture[:height, :width]
    return sheet


def _stored_pixels(file):
    """[H,W,4] f32 of a picture file as it is stored, top row first."""
    image = bpy.data.images.load(file)
    try:
        width, height = image.size
        flat = numpy.empty(width * height * 4, numpy.float32)
        image.pixels.foreach_get(flat)
        return flat.reshape(height, width, 4)[::-1]
    finally:
        bpy.data.images.remove(image)


def _set_icon(image, pixels):
    """The picture as the panel shows it, made here: Blender's own would come late or not at all."""
    step = math.ceil(max(pixels.shape[:2]) / ICON_SIZE)
    small = numpy.ascontiguousarray(pixels[::-step, ::step])
    icon = image.preview_ensure()
    icon.image_size = small.shape[1], small.shape[0]
    icon.image_pixels_float.foreach_set(small.ravel())


def _show(pixels):
    height, width = pixels.shape[:2]
    image = bpy.data.images.get(NAME)
    if image is None:
        image = bpy.data.images.new(NAME, width, height)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(numpy.ascontiguousarray(pixels[::-1]).ravel())
    image.update()
    _set_icon(image, pixels)
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR" and area.spaces.active.image in {None, image}:
                area.spaces.active.image = image
                area.tag_redraw()
    return image


def show_pictures(files):
    """Shows picture files of one size side by side; returns the image, None without files."""
    return _show(contact_sheet([_stored_pixels(f) for f in files])) if files else None


def show_page(page, folder):
    """Shows the first picture that is embedded in a preview page of the fit; None without one."""
    with open(page, encoding="utf-8") as file:
        found = re.search(r'src="data:image/(\w+);base64,([^"]+)"', file.read())
    if not found:
        return None
    path = os.path.join(folder, f"preview.{found[1]}")
    with open(path, "wb") as file:
        file.write(base64.b64decode(found[2]))
    try:
        return _show(_stored_pixels(path))
    finally:
        os.remove(path)
