# SPDX-License-Identifier: GPL-3.0-or-later
"""The program patina: where it is, and the arguments that settings become. Needs no Blender."""

import os
import shutil
from dataclasses import dataclass, field


class ProgramMissing(Exception):
    """There is no program to start; the text says what to do."""


@dataclass
class Options:
    """What the panel says. Empty texts and lists, and views of 0, leave patina's default."""

    prompt: str = ""
    negative_prompt: str = ""
    preset: str = "usual"
    strength: float = 1.0
    seed: int = 0
    views: int = 0
    model: str = ""
    model_folders: list = field(default_factory=list)
    config: str = ""  # a TOML file with any further options
    environment: str = ""  # a file; empty is the built-in studio
    maps: list = field(default_factory=list)  # base_color, roughness, metallic, normal
    materials: list = field(default_factory=list)
    where: list = field(default_factory=list)  # edges, crevices, ...; empty: everywhere


DRAFT_VIEWS, DRAFT_STEPS = 4, 12  # the preset fast, which `patina detail` does not have


def find_program(preferred):
    """Path of the program: `preferred`, or `patina` on the PATH. Throws ProgramMissing."""
    if preferred:
        if os.path.isfile(preferred) and os.access(preferred, os.X_OK):
            return os.path.abspath(preferred)
        raise ProgramMissing(
            f"'{preferred}' is no program. Correct the path in Preferences > Add-ons > patina"
        )
    found = shutil.which("patina")
    if found:
        return found
    raise ProgramMissing(
        "The program patina was not found on the PATH. "
        "Set its path in Preferences > Add-ons > patina"
    )


def _one(name, value):
    # With "=", a value that begins with a dash is no option.
    return [f"--{name}={value}"] if value not in ("", None) else []


def _each(name, values):
    return [f"--{name}={value}" for value in values]


def _model(options):
    return (
        _one("model", options.model)
        + _each("model-dir", options.model_folders)
        + _one("config", options.config)
    )


def _edit(options):
    return (
        _one("prompt", options.prompt)
        + _one("negative-prompt", options.negative_prompt)
        + _one("strength", f"{options.strength:.4g}")
        + _one("seed", options.seed)
        + _each("where", options.where)
    )


def enhance_command(program, options, asset, result, run):
    """`patina enhance` of the asset, with everything in between in the folder `run`."""
    return (
        [program, "enhance", asset, "-o", result, "--run", run, "--progress=json"]
        + _one("preset", options.preset)
        + _edit(options)
        + _model(options)
        + (_one("views", options.views) if options.views else [])
        + _one("environment", options.environment)
        + _each("fit", options.maps)
        + _each("material", options.materials)
    )


def draft_commands(program, options, asset, run):
    """`patina render` and `patina detail`: few edited views, no textures."""
    render = (
        [program, "render", asset, "--run", run, "--progress=json", "--preset=fast"]
        + _one("views", DRAFT_VIEWS)
        + _one("environment", options.environment)
        + _one("model", options.model)
        + _one("config", options.config)
        + _each("model-dir", options.model_folders)
        + _each("material", options.materials)
    )
    steps = [] if options.config else _one("steps", DRAFT_STEPS)
    detail = [program, "detail", run, "--progress=json"] + steps + _edit(options) + _model(options)
    return [render, detail]
