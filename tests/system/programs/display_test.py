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
