# SPDX-License-Identifier: GPL-3.0-or-later
"""The one job that runs: a process in the background, and a timer that looks after it.

The timer never waits. It reads events, redraws the panels, and when the program has ended it writes
the new maps into the materials, as one undo step.
"""

import os
import time

import bpy
from bpy.app.handlers import persistent

from . import assign, preview
from .events import Progress
from .process import BackgroundProcess

INTERVAL = 0.25  # seconds between two looks


class Runner:
    """A job that runs or has ended. `message` is what the panel says about it."""

    def __init__(self, job, image_folder):
        self.job = job
        self.image_folder = image_folder  # of the new images; empty packs them
        self.progress = Progress()
        self.message = ""
        self.is_error = False
        self.ended = False
        self._previews = 0
        self._num_stages = 0
        job.state = "running"
        job.save()
        self._process = BackgroundProcess(job.commands, job.folder)

    def stop(self):
        self._process.stop()

    def look(self):
        """Takes what came since the last look; returns whether the job still runs."""
        if self.ended:
            return False
        is_done = self._process.done  # asked before the lines are read, so that none is missed
        for line in self._process.lines():
            self.progress.take(line)
        self._show_pictures()
        if is_done:
            self._end()
        return not self.ended

    def _show_pictures(self):
        stages, progress = self.progress.finished_stages, self.progress
        new, self._num_stages = stages[self._num_stages :], len(stages)
        if "detail" in new:
            preview.show_pictures(self.job.pictures("detail", "edited"))
        elif "render" in new:
            preview.show_pictures(self.job.pictures("views", "tile"))
        if progress.num_previews > self._previews and os.path.exists(progress.preview_page):
            self._previews = progress.num_previews
            preview.show_page(progress.preview_page, self.job.folder)

    def _end(self):
        error, result = self.progress.error, self.progress.result
        if result is not None and self._process.exit_code == 0:
            if self.job.kind == "enhance" and not _can_write():
                self.progress.text = "Waiting for Object Mode to write the textures"
                return
            state, self.message = "finished", "The edited views are in the image 'patina preview'"
            if self.job.kind == "enhance":
                self._write_maps()
        elif self._process.stopped:
            state, self.message = (
                "stopped",
                "Stopped. It continues from here: Resume, or Draft again",
            )
        else:
            state, self.is_error = "failed", True
            about = f"{error['about']}: " if error and error.get("about") else ""
            text = about + error["text"] if error else self._process.start_error
            self.message = (
                text or f"patina ended with code {self._process.exit_code} and said nothing"
            )
        self.job.state = state
        self.job.save()
        self.ended = True

    def _write_maps(self):
        changed, faults = assign.assign_results(self.job.fitted_maps(), self.image_folder)
        self.message = f"New maps in {len(changed)} material{'s' if len(changed) != 1 else ''}"
        self.progress.warnings += faults
        windows = bpy.context.window_manager.windows
        with bpy.context.temp_override(window=windows[0]) if windows else _nothing():
            bpy.ops.ed.undo_push(message="patina: Enhance")


class _nothing:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False


def _can_write():
    # An undo step of edit or paint mode would not hold the materials.
    active = bpy.context.view_layer.objects.active
    return active is None or active.mode == "OBJECT"


_current = None


def current():
    """The job that runs or ended last in this session; None before the first."""
    return _current


def is_running():
    return _current is not None and not _current.ended


def start(job, image_folder):
    global _current
    _current = Runner(job, image_folder)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=INTERVAL)
    return _current


def wait(seconds=900):
    """For scripts without an event loop: looks until the job has ended."""
    end = time.monotonic() + seconds
    while is_running() and time.monotonic() < end:
        _current.look()
        time.sleep(0.05)
    return not is_running()


def _tick():
    more = _current is not None and _current.look()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            panels = {"VIEW_3D": "UI", "PROPERTIES": "WINDOW"}.get(area.type)
            for region in area.regions:  # not the 3D view itself, which may take long to draw
                if region.type == panels:
                    region.tag_redraw()
    return INTERVAL if more else None


@persistent
def _stop_before_load(*_):
    # Materials of another file may have the same names. Resume finds the job again.
    global _current
    left, _current = _current, None
    if left is None or left.ended:
        return
    left.stop()
    left.job.state = "stopped"
    try:
        left.job.save()
    except OSError as fault:  # its folder is gone, and with it all that Resume would continue
        print(f"patina: {fault}")


def register():
    bpy.app.handlers.load_pre.append(_stop_before_load)


def unregister():
    _stop_before_load()
    bpy.app.handlers.load_pre.remove(_stop_before_load)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
