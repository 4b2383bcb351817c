# SPDX-License-Identifier: GPL-3.0-or-later
"""What patina reports while it works: one JSON object a line (docs/progress.md of patina).

In: lines of text. Out: a Progress, which says what a person should see. Needs no Blender.
"""

import json
from dataclasses import dataclass, field

# A stage's part of the whole, roughly, for one bar over all stages.
STAGES = {
    "render": (0.00, 0.10, "Rendering the views"),
    "detail": (0.10, 0.55, "Editing the views"),
    "fit": (0.55, 0.90, "Fitting textures"),
    "report": (0.90, 1.00, "Writing the report"),
}
# Long tasks of each stage; shares of the others (noise, encode, decode) would make the bar jump.
MAIN_TASKS = {"render": "render", "detail": "detail", "fit": "fit", "report": "render"}


@dataclass
class Progress:
    """State of a run, as its events so far tell it."""

    share: float = 0.0  # of the whole, 0 to 1
    text: str = "Starting patina"
    seconds_left: float = None  # of the stage; None while unknown
    finished_stages: list = field(default_factory=list)
    preview_page: str = ""  # the newest page of the fit
    num_previews: int = 0
    warnings: list = field(default_factory=list)
    result: dict = None  # the `result` event
    error: dict = None  # the `error` event

    def take(self, line):
        """Reads one line. Lines that are no event, and events of later versions, are ignored."""
        try:
            event = json.loads(line)
        except ValueError:
            return
        if not isinstance(event, dict):
            return
        take = getattr(self, "_take_" + str(event.get("event")), None)
        if take:
            take(event)

    def _take_stage(self, event):
        begin, end, text = STAGES.get(event.get("stage"), (self.share, self.share, self.text))
        self.seconds_left = None
        if event.get("state") == "started":
            self.share, self.text = max(self.share, begin), text
        else:
            self.share = max(self.share, end)
            self.finished_stages.append(event.get("stage"))

    def _take_progress(self, event):
        stage = event.get("stage")
        if stage not in STAGES or event.get("task") != MAIN_TASKS[stage]:
            return
        begin, end, self.text = STAGES[stage]
        self.share = max(self.share, begin + (end - begin) * float(event.get("share") or 0))
        self.seconds_left = event.get("seconds_left")

    def _take_preview(self, event):
        self.preview_page = event.get("file", "")
        self.num_previews += 1

    def _take_warning(self, event):
        self.warnings.append(event.get("text", ""))

    def _take_result(self, event):
        self.result = event

    def _take_error(self, event):
        self.error = event
