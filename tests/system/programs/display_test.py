"""The simulator's window on a virtual display: loss of the display and shutdown."""
import shutil

from programs import *

RAIN = str(ROOT / "scripts/examples/rain.lua")


@unittest.skipUnless(HAS_XVFB, "Xvfb is not installed")
class Windows(ProgramTest):
    def open_display(self):
        """Starts a private X server."""
        server = Display("640x480")
        self.addCleanup(server.close)
        self.display = server.name
        return server

    def start_window(self, *flags):
        environment = {**os.environ, "DISPLAY": self.display}
        child = subprocess.Popen([SMARTSURF, "run", RAIN, "--no-controller", "--window", *flags], text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=self.folder, env=environment)
        self.children.append(child)
        return child

    def wait_for_recording(self, recording):
        self.wait_for(lambda: recording.exists() and recording.stat().st_size > 20_000, "the run goes on")

    def test_bounded_run_continues_without_display(self):
        server = self.open_display()
        recording = self.folder / "run.h5"
        child = self.start_window("--until", "3", "--record", str(recording))
        self.wait_for_recording(recording)
        server.close()
        status, _, err = self.finish(child)
        self.assertEqual(status, 0, err)
        self.assertIn("the display was lost; the run continues without a window", err)
        self.assertIn("done after 180 ticks", self.run_program(SMARTSURF, "info", str(recording))[1])

    def test_unbounded_run_ends_with_display(self):
        server = self.open_display()
        recording = self.folder / "run.h5"
        child = self.start_window("--record", str(recording), "--set", "count=100000")
        self.wait_for_recording(recording)
        server.close()
        status, _, err = self.finish(child)
        self.assertEqual(status, 1, err)
        self.assertIn("the display was lost; the run ends", err)
        self.assertIn("the display was lost", self.run_program(SMARTSURF, "info", str(recording))[1])

    def test_missing_display_reports_one_line(self):
        self.display = ":4711"
        status, _, err = self.finish(self.start_window("--until", "1"))
        self.assertEqual(status, 2)
        self.assertEqual(err.count("\n"), 1, err)

    def test_a_saved_experiment_is_reloaded_and_one_with_an_error_is_not(self):
        self.open_display()
        text = pathlib.Path(RAIN).read_text()
        script = pathlib.Path(self.write("rain.lua", text + "print('first')\n"))
        child = subprocess.Popen([SMARTSURF, "run", str(script), "--no-controller", "--window", "--set", "count=5"], text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=self.folder,
                                 env={**os.environ, "DISPLAY": self.display, "XDG_CONFIG_HOME": str(self.folder / "config")})
        self.children.append(child)

        def wait_for_line(word):
            for line in child.stdout:
                if word in line:
                    return
            self.fail(f"no {word}")
        wait_for_line("first")
        script.write_text(text + "print('broken'\n")
        time.sleep(1)
        self.assertIsNone(child.poll())
        script.write_text(text + "print('second')\n")
        wait_for_line("second")
        self.assertEqual((self.folder / "config/smartsurf/recent").read_text(), f"{script}\n")
        child.send_signal(signal.SIGTERM)
        self.assertEqual(child.wait(30), 143)

    def test_start_screen_without_arguments_ends_on_a_signal(self):
        self.open_display()
        environment = {**os.environ, "DISPLAY": self.display, "XDG_CONFIG_HOME": "/proc/nowhere"}
        child = subprocess.Popen([SMARTSURF], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment)
        self.children.append(child)
        self.wait_for_handler(child, signal.SIGTERM)
        time.sleep(2)
        self.assertIsNone(child.poll())
        child.send_signal(signal.SIGTERM)
        status, out, err = self.finish(child)
        self.assertEqual((status, out, err), (143, "", ""))

    @unittest.skipUnless(shutil.which("xdotool"), "xdotool is not installed")
    def test_q_ends_run_cleanly(self):
        self.open_display()
        recording = self.folder / "run.h5"
        child = self.start_window("--record", str(recording))
        self.wait_for_recording(recording)
        environment = {**os.environ, "DISPLAY": self.display}
        while child.poll() is None:  # the window has no focus before its first frame
            subprocess.run(["xdotool", "key", "q"], env=environment, check=False)
            time.sleep(0.2)
        status, _, err = self.finish(child)
        self.assertEqual(status, 0, err)
        self.assertIn("stopped by the user", self.run_program(SMARTSURF, "info", str(recording))[1])


if __name__ == "__main__":
    unittest.main()
