# SPDX-License-Identifier: GPL-3.0-or-later
"""Events, processes and arguments, which need no Blender."""

import sys
import tempfile
import time
import unittest

from patina_enhance import events, process, program


class Events(unittest.TestCase):
    def test_stages_move_one_bar_forward(self):
        progress, shares = events.Progress(), []
        for line in (
            '{"event":"stage","stage":"render","state":"started"}',
            '{"event":"progress","stage":"render","task":"render","share":0.5,"seconds_left":3.0}',
            '{"event":"stage","stage":"render","state":"finished"}',
            '{"event":"stage","stage":"detail","state":"reused"}',
            '{"event":"stage","stage":"fit","state":"started"}',
            '{"event":"progress","stage":"fit","task":"fit","share":0.5,"seconds_left":null}',
        ):
            progress.take(line)
            shares.append(progress.share)
        self.assertEqual(shares, sorted(shares))
        self.assertLess(shares[0], shares[-1])
        self.assertEqual(progress.finished_stages, ["render", "detail"])

    def test_unknown_events_and_other_lines_are_ignored(self):
        progress = events.Progress()
        for line in (
            '{"event":"of a later version","x":1}',
            "Killed",
            "[1]",
            "null",
            '{"event":5}',
            "",
        ):
            progress.take(line)
        self.assertEqual(progress, events.Progress())

    def test_unknown_stages_do_not_move_the_bar(self):
        progress = events.Progress(share=0.3)
        progress.take('{"event":"stage","stage":"bake","state":"started"}')
        progress.take('{"event":"progress","stage":"bake","task":"bake","share":0.9}')
        self.assertEqual(progress.share, 0.3)

    def test_error_result_and_warnings_are_kept(self):
        progress = events.Progress()
        progress.take('{"event":"warning","text":"few views"}')
        progress.take('{"event":"result","asset":"/x.glb"}')
        progress.take('{"event":"error","kind":"io","about":"/x","text":"cannot","exit_code":1}')
        self.assertEqual(progress.warnings, ["few views"])
        self.assertEqual(progress.result["asset"], "/x.glb")
        self.assertEqual(progress.error["about"], "/x")


def python(code):
    return [sys.executable, "-c", code]


class Process(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name

    def test_commands_run_in_turn_until_one_fails(self):
        say = "import sys; print('{}', file=sys.stderr); sys.exit({})"
        run = process.BackgroundProcess(
            [
                python(say.format("one", 0)),
                python(say.format("two", 3)),
                python(say.format("three", 0)),
            ],
            self.folder,
        )
        run.wait(30)
        self.assertEqual([line.strip() for line in run.lines()], ["one", "two"])
        self.assertEqual(run.exit_code, 3)

    def test_start_and_look_do_not_wait(self):
        begin = time.monotonic()
        run = process.BackgroundProcess([python("import time; time.sleep(60)")], self.folder)
        self.assertEqual(list(run.lines()), [])
        self.assertFalse(run.done)
        self.assertLess(time.monotonic() - begin, 5)
        time.sleep(0.5)
        run.stop()
        run.wait(20)
        self.assertTrue(run.done and run.stopped)
        self.assertNotEqual(run.exit_code, 0)

    def test_a_program_that_does_not_start_is_named(self):
        run = process.BackgroundProcess([["/no/such/program"]], self.folder)
        run.wait(10)
        self.assertIn("/no/such/program", run.start_error)
        self.assertIsNone(run.exit_code)

    def test_output_that_is_no_utf8_is_read(self):
        code = r"import sys; sys.stderr.buffer.write(b'\xff\xfe\n')"
        run = process.BackgroundProcess([python(code)], self.folder)
        run.wait(30)
        self.assertEqual(len(list(run.lines())), 1)


class Program(unittest.TestCase):
    def test_values_that_look_like_options_stay_values(self):
        options = program.Options(prompt="--help", materials=["-a", "b,c"], negative_prompt="-x")
        command = program.enhance_command("patina", options, "a.glb", "b.glb", "run")
        for argument in (
            "--prompt=--help",
            "--material=-a",
            "--material=b,c",
            "--negative-prompt=-x",
        ):
            self.assertIn(argument, command)

    def test_empty_settings_leave_the_programs_defaults(self):
        command = program.enhance_command("patina", program.Options(prompt="x"), "a", "b", "run")
        text = " ".join(command)
        for option in (
            "--views",
            "--model",
            "--environment",
            "--negative-prompt",
            "--config",
            "--fit",
            "--where",
        ):
            self.assertNotIn(option + "=", text)

    def test_places_go_to_draft_and_enhance(self):
        options = program.Options(prompt="x", where=["drips", "edges"])
        enhance = program.enhance_command("patina", options, "a", "b", "run")
        _, detail = program.draft_commands("patina", options, "a", "run")
        for command in (enhance, detail):
            self.assertIn("--where=drips", command)
            self.assertIn("--where=edges", command)

    def test_a_wrong_path_is_named(self):
        with self.assertRaisesRegex(program.ProgramMissing, "/no/such/patina"):
            program.find_program("/no/such/patina")
