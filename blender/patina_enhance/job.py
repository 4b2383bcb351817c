# SPDX-License-Identifier: GPL-3.0-or-later
"""A job on disk: what was started, for which materials, and how it ended. Needs no Blender.

<folder>/asset.glb, environment.exr   what patina reads
<folder>/result.glb, run/, draft/     what it writes
<folder>/job.json                     this file's Job, so that Resume works after a restart too
"""

import json
import os
import re
from dataclasses import asdict, dataclass, field

MAPS = ("base_color", "roughness", "metallic", "normal")


@dataclass
class Job:
    folder: str
    kind: str  # "enhance" or "draft"
    commands: list
    materials: list  # all of the asset, in its order
    state: str = "running"  # then "finished", "stopped" or "failed"
    warnings: list = field(default_factory=list)  # of the export

    @property
    def run(self):
        return os.path.join(self.folder, "run" if self.kind == "enhance" else "draft")

    @property
    def report(self):
        return os.path.join(self.folder, "run", "report.html")

    def save(self):
        if self.kind == "draft":  # the same button continues it
            return
        path = _job_file(self.folder)
        with open(path + ".new", "w", encoding="utf-8") as file:
            json.dump(asdict(self), file, ensure_ascii=False, indent=1)
        os.replace(path + ".new", path)

    def fitted_maps(self):
        """[(material's name, map's name, file)] as the run folder's record of the fit has it."""
        with open(os.path.join(self.run, "stages.json"), encoding="utf-8") as file:
            stages = json.load(file)
        fit = next(stage for stage in stages if stage["name"] == "fit")
        return [
            (self.materials[m["material"]], m["slot"], os.path.join(self.run, m["file"]))
            for m in fit["metrics"]["maps"]
            if m["material"] < len(self.materials)
        ]

    def pictures(self, folder, prefix):
        """Files of a stage's pictures in order: ("views", "tile") or ("detail", "edited")."""
        path = os.path.join(self.run, folder)
        names = sorted(os.listdir(path)) if os.path.isdir(path) else []
        wanted = re.compile(rf"{prefix}_\d+\.png$")
        return [os.path.join(path, name) for name in names if wanted.match(name)]


def _job_file(folder):
    return os.path.join(folder, "job.json")


def load_job(folder):
    """The last job of the folder; None without one, or where its file is damaged."""
    try:
        with open(_job_file(folder), encoding="utf-8") as file:
            return Job(**dict(json.load(file), folder=folder))
    except (OSError, ValueError, TypeError):
        return None


def safe_name(text):
    """A text as a part of a file name."""
    return re.sub(r"[^\w.-]+", "_", text).strip("._")[:60] or "object"
