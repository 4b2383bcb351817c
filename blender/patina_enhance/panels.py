# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels: tab "patina" in the 3D view's sidebar, and one in the material properties."""

import textwrap

import bpy

from . import assign, preview, runner
from .export import chosen_objects, enhanceable, materials_of
from .operators import compared_materials
from .uvs import meshes_without_uvs


def _paragraph(layout, text, icon="NONE"):
    """A text that is wrapped, since labels are cut at the panel's edge."""
    scale = bpy.context.preferences.system.ui_scale
    # Pixels beside the text (margins, icon, tabs) and of an average letter, in Blender's own font.
    width = max(12, int((bpy.context.region.width / scale - 86) / 6.6))
    column = layout.column(align=True)
    for i, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


def _draw_bar(layout, share, text):
    if hasattr(layout, "progress"):  # since Blender 4.0
        layout.progress(factor=share, text=text)
        return
    done = min(max(share, 0.001), 0.999)
    split = layout.split(factor=done, align=True)
    split.operator("patina.progress", text=f"{share:.0%}" if done > 0.2 else "", depress=True)
    split.operator("patina.progress", text=f"{share:.0%}" if done <= 0.2 else "")
    layout.label(text=text)


class PATINA_OT_progress(bpy.types.Operator):
    """How much of the job is done"""

    bl_idname = "patina.progress"
    bl_label = "Progress"

    def execute(self, _context):
        return {"FINISHED"}


def draw_job(layout, context):
    """The job that runs, or how the last one ended."""
    run = runner.current()
    if run is None:
        return
    box = layout.box()
    progress = run.progress
    if not run.ended:
        text = progress.text
        if progress.seconds_left:
            text += f", {round(progress.seconds_left)} s left"
        _draw_bar(box, progress.share, text)
        box.operator("patina.cancel", icon="CANCEL")
    else:
        _paragraph(box, run.message, "ERROR" if run.is_error else "CHECKMARK")
    image = bpy.data.images.get(preview.NAME)
    if image is not None and image.preview is not None:
        box.template_icon(icon_value=image.preview.icon_id, scale=8)
    for text in (run.job.warnings + progress.warnings)[:4]:
        _paragraph(box, text, "INFO")


def draw_start(layout, context):
    """Draft, Enhance and what follows them."""
    without = meshes_without_uvs(chosen_objects(context))
    if without:
        _paragraph(layout, "No UVs: " + ", ".join(obj.name for obj in without), "ERROR")
        layout.operator("patina.unwrap", icon="UV")
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.operator("patina.draft", icon="IMAGE_DATA")
    row.operator("patina.enhance", icon="SHADERFX")
    row = layout.row(align=True)
    row.operator("patina.resume", icon="PLAY")
    row.operator("patina.report", icon="URL")
    compared = compared_materials(context)
    is_new = not compared or assign.shows_new(compared[0])
    layout.operator(
        "patina.compare",
        text="Compare: New Maps" if is_new else "Compare: Old Maps",
        icon="HIDE_OFF" if is_new else "HIDE_ON",
        depress=bool(compared) and not is_new,
    )


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "patina"


class PATINA_PT_main(_Sidebar, bpy.types.Panel):
    bl_label = "patina"

    def draw(self, context):
        layout, settings = self.layout, context.scene.patina
        column = layout.column()
        column.prop(settings, "prompt", text="", icon="GREASEPENCIL")
        column.use_property_split, column.use_property_decorate = True, False
        for name in ("negative_prompt", "preset", "strength", "seed", "environment"):
            column.prop(settings, name)
        draw_start(layout, context)
        draw_job(layout, context)


class PATINA_PT_materials(_Sidebar, bpy.types.Panel):
    bl_label = "Materials"
    bl_parent_id = "PATINA_PT_main"

    def draw(self, context):
        materials = materials_of(chosen_objects(context))
        if not materials:
            self.layout.label(text="Select objects with materials")
        for material in materials:
            fault = enhanceable(material)
            row = self.layout.row()
            row.active = not fault
            row.prop(material.patina_settings, "enhance", text=material.name, translate=False)
            if fault:
                _paragraph(self.layout, fault, "ERROR")


class PATINA_PT_more(_Sidebar, bpy.types.Panel):
    bl_label = "More"
    bl_parent_id = "PATINA_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = self.layout, context.scene.patina
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("views", "model", "config", "images"):
            layout.prop(settings, name)
        layout.column().prop(settings, "maps")
        layout.column().prop(settings, "where")


class PATINA_PT_material(bpy.types.Panel):
    """In the material properties: whether patina may change it, and the buttons."""

    bl_label = "patina"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.material is not None

    def draw(self, context):
        layout, material = self.layout, context.material
        if fault := enhanceable(material):
            _paragraph(layout, f"This material {fault}", "ERROR")
            return
        layout.prop(material.patina_settings, "enhance")
        layout.prop(context.scene.patina, "prompt")
        draw_start(layout, context)
        draw_job(layout, context)


CLASSES = (
    PATINA_OT_progress,
    PATINA_PT_main,
    PATINA_PT_materials,
    PATINA_PT_more,
    PATINA_PT_material,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
