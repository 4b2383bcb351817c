# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sets: for the computer (preferences), for the scene, and for each material."""

import os

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .job import MAPS, safe_name
from .program import Options


class PATINA_ModelFolder(bpy.types.PropertyGroup):
    path: StringProperty(
        name="Folder", subtype="DIR_PATH", description="Folder of models, such as that of ComfyUI"
    )


class PATINA_Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(
        name="Program",
        subtype="FILE_PATH",
        description="The program patina. Empty looks on the PATH",
    )
    model_folders: CollectionProperty(type=PATINA_ModelFolder)

    def draw(self, _context):
        layout = self.layout
        layout.prop(self, "program")
        layout.label(text="Model folders, where patina looks for models by name:")
        for i, folder in enumerate(self.model_folders):
            row = layout.row(align=True)
            row.prop(folder, "path", text="")
            row.operator("patina.remove_model_folder", text="", icon="REMOVE").index = i
        layout.operator("patina.add_model_folder", icon="ADD")


class PATINA_Scene(bpy.types.PropertyGroup):
    prompt: StringProperty(
        name="Prompt", description='What the asset should look like, such as "a rusty old kettle"'
    )
    negative_prompt: StringProperty(
        name="Negative",
        description="What it should not look like. Empty takes the model's own words",
    )
    preset: EnumProperty(
        name="Preset",
        items=[
            ("usual", "Usual", "9 views, 20 steps"),
            ("fast", "Fast", "4 views, 12 steps: to try prompts"),
            ("quality", "Quality", "16 views, 30 steps: for the final run"),
        ],
    )
    strength: FloatProperty(
        name="Strength",
        description="How much may change. At 1 the prompt decides everything",
        min=0.01,
        max=1.0,
        default=1.0,
        subtype="FACTOR",
    )
    seed: IntProperty(name="Seed", description="The same seed gives the same result", min=0)
    model: StringProperty(
        name="Model",
        description="A diffusers folder, a .safetensors file, or a name in the model folders. "
        "Empty takes patina-mini, which comes with patina",
    )
    views: EnumProperty(
        name="Views",
        items=[
            ("0", "Of the preset", "As many as the preset has"),
            ("4", "4", "Four views"),
            ("9", "9", "Nine views"),
            ("16", "16", "Sixteen views: sees most of the surface"),
        ],
    )
    environment: EnumProperty(
        name="Light",
        items=[
            ("STUDIO", "Studio", "patina's built-in studio"),
            ("WORLD", "Scene World", "The world of this scene, rendered by Cycles"),
        ],
    )
    maps: EnumProperty(
        name="Maps",
        description="Which maps may change",
        options={"ENUM_FLAG"},
        items=[(name, name.replace("_", " ").capitalize(), "") for name in MAPS],
        default={"base_color", "roughness", "normal"},
    )
    where: EnumProperty(
        name="Where",
        description="Only there: masks that patina makes from the shape. None: everywhere",
        options={"ENUM_FLAG"},
        items=[
            ("edges", "Edges", "The surface bends away"),
            ("crevices", "Crevices", "It is closed in nearby"),
            ("cavities", "Cavities", "Other surface hides the sky"),
            ("up", "Up", "It faces up"),
            ("down", "Down", "It faces down"),
            ("drips", "Drips", "Streaks run down from upper rims"),
        ],
        default=set(),
    )
    config: StringProperty(
        name="Options File",
        subtype="FILE_PATH",
        description="A TOML file with any further options of `patina enhance`",
    )
    images: EnumProperty(
        name="New Images",
        items=[
            ("PACK", "Pack", "Keep them in the .blend file"),
            ("FILES", "Files", "Write them to textures/patina beside the .blend file"),
        ],
    )


class PATINA_Material(bpy.types.PropertyGroup):
    enhance: BoolProperty(
        name="Enhance", description="patina may change this material", default=True
    )


def preferences(context):
    return context.preferences.addons[__package__].preferences


def options_of(context, materials, environment):
    """The program's options. `materials` are names; `environment` is a file, or empty."""
    settings, path = context.scene.patina, bpy.path.abspath
    folders = [path(f.path) for f in preferences(context).model_folders if f.path]
    return Options(
        prompt=settings.prompt,
        negative_prompt=settings.negative_prompt,
        preset=settings.preset,
        strength=settings.strength,
        seed=settings.seed,
        views=int(settings.views),
        model=path(settings.model) if settings.model.startswith("//") else settings.model,
        model_folders=folders,
        config=path(settings.config) if settings.config else "",
        environment=environment,
        maps=[name for name in MAPS if name in settings.maps],
        materials=materials,
        where=sorted(settings.where),
    )


def job_folder(leading):
    """Where the job of an object lives: beside the .blend file, or in Blender's temporary
    folder while there is none."""
    blend = bpy.data.filepath
    base = os.path.dirname(blend) if blend else bpy.app.tempdir
    stem = os.path.splitext(os.path.basename(blend))[0] if blend else "unsaved"
    return os.path.join(base, "patina-runs", safe_name(stem), safe_name(leading.name))


def image_folder(context):
    """Where new images go; empty packs them, as for a .blend file that was never saved."""
    if context.scene.patina.images == "PACK" or not bpy.data.filepath:
        return ""
    return os.path.join(os.path.dirname(bpy.data.filepath), "textures", "patina")


CLASSES = (PATINA_ModelFolder, PATINA_Preferences, PATINA_Scene, PATINA_Material)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.patina = PointerProperty(type=PATINA_Scene)
    bpy.types.Material.patina_settings = PointerProperty(type=PATINA_Material)


def unregister():
    del bpy.types.Material.patina_settings
    del bpy.types.Scene.patina
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
