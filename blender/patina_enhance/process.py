# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs commands in the background: one after another, until one fails.

In: lists of arguments. Out: lines of standard error, in a queue that the caller empties when it
likes; no call waits. Needs no Blender.
"""

import atexit
import os
import queue
import subprocess
import threading


class BackgroundProcess:
    """Starts at once. `lines()` hands over what came since the last call; `done` turns true after
    the last line. A process that is still there when Blender ends is stopped."""

    def __init__(self, commands, folder):
        self._commands = [list(map(str, command)) for command in commands]
        self._folder = folder
        self._lines = queue.SimpleQueue()
        self._process = None
        self._lock = threading.Lock()
        self._stopping = False
        self.exit_code = None  # of the last command; None while it runs, or if it did not start
        self.start_error = ""  # why a command did not start
        self._thread = threading.Thread(target=self._run, name="patina", daemon=True)
        atexit.register(self.stop)
        self._thread.start()

    @property
    def done(self):
        return not self._thread.is_alive()

    @property
    def stopped(self):
        """Whether `stop` was called before the end."""
        return self._stopping

    def lines(self):
        """The lines that have come since the last call."""
        while True:
            try:
                yield self._lines.get_nowait()
            except queue.Empty:
                return

    def stop(self):
        """Asks the program to stop (on Windows, ends it). The same command continues later."""
        with self._lock:
            if self.done:
                return
            self._stopping = True
            if self._process is not None and self._process.poll() is None:
                self._process.terminate()

    def wait(self, seconds=None):
        self._thread.join(seconds)

    def _run(self):
        code = 0
        for command in self._commands:
            code = self._run_one(command)
            if code != 0:
                break
        self.exit_code = code
        atexit.unregister(self.stop)

    def _run_one(self, command):
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}
        with self._lock:
            if self._stopping:
                return None
            try:
                self._process = subprocess.Popen(
                    command,
                    cwd=self._folder,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    text=True,
                    encoding="utf-8",
                    errors="replace",
                    **hidden,
                )
            except OSError as error:
                self.start_error = f"{command[0]}: {error.strerror or error}"
                return None
        with self._process.stderr:
            for line in self._process.stderr:
                self._lines.put(line)
        return self._process.wait()
