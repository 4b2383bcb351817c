# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons."""

import os
import pathlib

import bpy

from . import assign, runner
from .export import (
    ExportError,
    chosen_objects,
    export_objects,
    materials_of,
)
from .job import Job, load_job, safe_name
from .program import ProgramMissing, draft_commands, enhance_command, find_program
from .settings import image_folder, job_folder, options_of, preferences
from .uvs import meshes_without_uvs, smart_project
from .world import save_world


def objects_to_enhance(context):
    """The selected meshes, the active one first, because the job has its name."""
    objects = chosen_objects(context)
    active = context.view_layer.objects.active
    return sorted(objects, key=lambda obj: obj != active)


def _write_asset(context, objects):
    """Exports objects and light into the job's folder: (folder, asset, Exported, Options)."""
    wanted = [m for m in materials_of(objects) if m.patina_settings.enhance]
    exported = export_objects(context, objects, wanted)
    folder = job_folder(objects[0])
    os.makedirs(folder, exist_ok=True)
    asset = os.path.join(folder, safe_name(objects[0].name) + ".glb")
    pathlib.Path(asset).write_bytes(exported.data)
    environment = ""
    if context.scene.patina.environment == "WORLD":
        if context.scene.world is None:
            raise ExportError("The scene has no world. Give it one, or choose the studio as light")
        environment = os.path.join(folder, "environment.exr")
        save_world(context.scene.world, environment)
    options = options_of(context, [m.name for m in wanted], environment)
    return folder, asset, exported, options


class _Start:
    """Enhance and Draft: they differ in their commands."""

    @classmethod
    def poll(cls, context):
        return not runner.is_running() and context.mode == "OBJECT"

    def execute(self, context):
        settings = context.scene.patina
        if not settings.prompt.strip():
            self.report({"ERROR"}, "Say in the prompt what the objects should look like")
            return {"CANCELLED"}
        if not settings.maps:
            self.report({"ERROR"}, "Choose at least one map that may change")
            return {"CANCELLED"}
        try:
            program = find_program(bpy.path.abspath(preferences(context).program))
            folder, asset, exported, options = _write_asset(context, objects_to_enhance(context))
        except (ProgramMissing, ExportError, OSError) as fault:
            self.report({"ERROR"}, str(fault))
            return {"CANCELLED"}
        commands = self.commands(program, options, asset, folder)
        job = Job(folder, self.kind, commands, exported.materials, warnings=exported.warnings)
        runner.start(job, image_folder(context))
        return {"FINISHED"}


class PATINA_OT_enhance(_Start, bpy.types.Operator):
    """Let patina make new maps for the chosen materials of the selected objects"""

    bl_idname = "patina.enhance"
    bl_label = "Enhance"
    kind = "enhance"

    @staticmethod
    def commands(program, options, asset, folder):
        result, run = os.path.join(folder, "result.glb"), os.path.join(folder, "run")
        return [enhance_command(program, options, asset, result, run)]


class PATINA_OT_draft(_Start, bpy.types.Operator):
    """Edit four views only, in seconds, and show them in the image editor. Nothing is changed"""

    bl_idname = "patina.draft"
    bl_label = "Draft"
    kind = "draft"

    @staticmethod
    def commands(program, options, asset, folder):
        return draft_commands(program, options, asset, os.path.join(folder, "draft"))


class PATINA_OT_cancel(bpy.types.Operator):
    """Stop. What is done so far is kept, and Resume continues from there"""

    bl_idname = "patina.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, _context):
        return runner.is_running()

    def execute(self, _context):
        runner.current().stop()
        return {"FINISHED"}


def job_of_selection(context):
    """The last Enhance of the selected objects; None without one."""
    objects = objects_to_enhance(context)
    return load_job(job_folder(objects[0])) if objects else None


class PATINA_OT_resume(bpy.types.Operator):
    """Continue the run of the selected objects that was stopped, with the settings it had"""

    bl_idname = "patina.resume"
    bl_label = "Resume"

    @classmethod
    def poll(cls, context):
        if runner.is_running() or context.mode != "OBJECT":
            return False
        job = job_of_selection(context)
        return job is not None and job.state != "finished"

    def execute(self, context):
        job = job_of_selection(context)
        try:
            program = find_program(bpy.path.abspath(preferences(context).program))
        except ProgramMissing as fault:
            self.report({"ERROR"}, str(fault))
            return {"CANCELLED"}
        job.commands = [[program, *command[1:]] for command in job.commands]
        runner.start(job, image_folder(context))
        return {"FINISHED"}


class PATINA_OT_report(bpy.types.Operator):
    """Open the report of the selected objects' last run in the web browser"""

    bl_idname = "patina.report"
    bl_label = "Report"

    @classmethod
    def poll(cls, context):
        job = job_of_selection(context)
        return job is not None and os.path.exists(job.report)

    def execute(self, context):
        bpy.ops.wm.url_open(url=pathlib.Path(job_of_selection(context).report).as_uri())
        return {"FINISHED"}


def compared_materials(context):
    """Materials of the selected objects that have maps of patina."""
    return [m for m in materials_of(chosen_objects(context)) if assign.has_record(m)]


class PATINA_OT_compare(bpy.types.Operator):
    """Show the selected objects with their old maps, or with their new ones again"""

    bl_idname = "patina.compare"
    bl_label = "Compare"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return bool(compared_materials(context))

    def execute(self, context):
        materials = compared_materials(context)
        new = not assign.shows_new(materials[0])
        for material in materials:
            assign.show(material, new)
        return {"FINISHED"}


class PATINA_OT_unwrap(bpy.types.Operator):
    """Unwrap the selected meshes that have no UVs with Smart UV Project"""

    bl_idname = "patina.unwrap"
    bl_label = "Smart UV Project"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and bool(meshes_without_uvs(chosen_objects(context)))

    def execute(self, context):
        smart_project(context, meshes_without_uvs(chosen_objects(context)))
        return {"FINISHED"}


class PATINA_OT_add_model_folder(bpy.types.Operator):
    """Add a folder in which patina looks for models by name"""

    bl_idname = "patina.add_model_folder"
    bl_label = "Add Model Folder"

    def execute(self, context):
        preferences(context).model_folders.add()
        return {"FINISHED"}


class PATINA_OT_remove_model_folder(bpy.types.Operator):
    """Remove this folder from the list. The folder itself stays"""

    bl_idname = "patina.remove_model_folder"
    bl_label = "Remove Model Folder"

    index: bpy.props.IntProperty(options={"HIDDEN"})

    def execute(self, context):
        preferences(context).model_folders.remove(self.index)
        return {"FINISHED"}


CLASSES = (
    PATINA_OT_enhance,
    PATINA_OT_draft,
    PATINA_OT_cancel,
    PATINA_OT_resume,
    PATINA_OT_report,
    PATINA_OT_compare,
    PATINA_OT_unwrap,
    PATINA_OT_add_model_folder,
    PATINA_OT_remove_model_folder,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
