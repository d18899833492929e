"""Wrong input: one clear line on stderr, exit status 2, and nothing half-written."""
from programs import *

TABLE = "surface { rows = 8, columns = 8, actuator = pin {}, sensors = { proximity {} } }\n"


class Mistakes(ProgramTest):
    def refused(self, command, *facts):
        status, _, err = self.run_program(*command)
        lines = err.strip().splitlines()
        self.assertEqual(status, 2, err)
        self.assertEqual(len(lines), 1, err)
        for fact in facts:
            self.assertIn(fact, lines[0])

    def test_experiments(self):
        self.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
        for text, *facts in [
            (TABLE + "spere { radius = 1, position = {1, 1, 1} }", ":2:", "spere", "sphere"),
            (TABLE + "sphere { raduis = 1, position = {1, 1, 1} }", ":2:", "raduis", "radius"),
            (TABLE + "sphere { radius = 0/0, position = {1, 1, 1} }", ":2:", "radius"),
            (TABLE + "sphere { radius = -1, position = {1, 1, 1} }", ":2:", "radius", "-1"),
            (TABLE + "sphere { radius = 1, position = {1, 1/0, 1} }", ":2:", "position"),
            (TABLE + "world { dt = 'fast' }", ":2:", "dt", "fast"),
            (TABLE + "if then", ":2:"),
            (TABLE + "while true do end", ":2:", "instructions"),
            (TABLE + "mesh { file = 'none.stl', position = {1, 1, 1} }", ":2:", "none.stl", "does not exist"),
            (TABLE + "mesh { file = 'wrong.lua', position = {1, 1, 1} }", ":2:", "wrong.lua", ".stl"),
            (TABLE + "mesh { file = 'open.obj', position = {1, 1, 1} }", ":2:", "open.obj", "3 edges", "(1, 0, 0)"),
            (TABLE + "hull { points = {{0, 0, 0}}, position = {1, 1, 1} }", ":2:", "points", "four"),
            ("world {}\n", "surface"),
        ]:
            path = self.write("wrong.lua", text)
            self.refused([SMARTSURF, "check", path], "wrong.lua", *facts)
            self.refused([SMARTSURF, "run", path, "--no-controller", "--ticks", "1"], "wrong.lua", *facts)

    def test_a_script_that_fails_while_running_keeps_the_recording(self):
        path = self.write("late.lua", TABLE + "at(0.5, function()\n  local x = nil + 1\nend)\n")
        self.refused([SMARTSURF, "run", path, "--no-controller", "--ticks", "100", "--record",
                      str(self.folder / "late.h5")], "late.lua:3:")
        status, out, _ = self.run_program(SMARTSURF, "info", str(self.folder / "late.h5"))
        self.assertEqual(status, 0)
        self.assertIn("late.lua:3:", out)

    def test_flags(self):
        path = self.write("ok.lua", TABLE)
        run = [SMARTSURF, "run", path, "--no-controller", "--ticks", "1"]
        self.refused([SMARTSURF, "run", str(self.folder / "none.lua")], "none.lua")
        self.refused([SMARTSURF, "run"], "EXPERIMENT.lua")
        self.refused([SMARTSURF, "fly"], "fly")
        self.refused([SMARTSURF])
        self.refused(run + ["--spede", "2"], "--spede")
        self.refused(run + ["--pace", "fast"], "--pace", "fast")
        self.refused(run + ["--pace", "-1"], "--pace", "-1")
        self.refused(run + ["--mode", "both"], "both")
        self.refused(run + ["--set", "x"], "--set", "NAME=VALUE")
        self.refused(run + ["--set", "size=3"], "size")
        self.refused(run + ["--controller-set", "gain=3"], "--controller-set", "--controller PROGRAM.aps")
        self.refused(run + ["--record", "run.txt"], "run.txt")
        self.refused(run + ["--record", "/nowhere/run.h5"], "/nowhere")
        self.refused(run + ["--stats", "/nowhere/run.json"], "/nowhere")
        self.refused(run + ["--screenshot", "a.jpg"], "a.jpg", ".png")
        self.refused(run + ["--screenshot", "a.png@late"], "late")
        self.refused(run + ["--video", "a.avi"], "a.avi", ".mp4")
        self.refused(run + ["--video", "/nowhere/a.mp4"], "/nowhere")
        self.refused([SMARTSURF, "run", path, "--until", "nan"], "--until")
        self.refused([SMARTSURF, "run", path, "--controller", "none.aps"], "none.aps")
        self.refused([SMARTSURF, "run", path, "--shm", "no/such/name"], "no/such/name")
        self.refused([SMARTSURF, "info", path], "ok.lua")
        self.refused([SMARTSURF, "plot", path, "-o", "x.svg"], "ok.lua")
        self.refused([APRON, "run", str(self.folder / "none.aps")], "none.aps")
        self.refused([APRON, "run", SORT_APS, "--shm", "nobody", "--wait", "0"], "nobody")
        self.refused([APRON, "run", SORT_APS, "--size", "0x5"], "0x5")

    def test_settings_of_the_controller(self):
        experiment = self.write("ok.lua", TABLE)
        program = self.write("gain.aps", "sim.slider.add('gain', 0, 9, 1)\nprintln('gain ', sim.slider.get('gain'))\n")
        run = [SMARTSURF, "run", experiment, "--controller", program]
        status, out, err = self.run_program(*run, "--controller-set", "gain=3")
        self.assertEqual(status, 0, err)
        self.assertIn("gain 3", out)
        status, _, err = self.run_program(*run, "--controller-set", "gian=3")
        self.assertEqual(status, 2)
        self.assertIn("apron: error: --set: the program has no slider or switch 'gian'; it has gain", err)
        status, _, err = self.run_program(*run, "--set", "gain=3")
        self.assertEqual(status, 2)
        self.assertIn("no option 'gain'", err)

    def test_programs(self):
        path = self.write("wrong.aps", "!register(SIGNAL)\nSIGNAL = SIGNL + 1\n")
        for command in ("check", "run"):
            status, _, err = self.run_program(APRON, command, path)
            self.assertEqual(status, 2)
            first = err.strip().splitlines()
            self.assertIn("wrong.aps:2:10: error:", first[0])
            self.assertIn("SIGNL", first[0])
            self.assertIn("SIGNAL", err)
            self.assertIn("^", err)

    def test_a_controller_with_a_mistake_ends_the_run_as_the_users_mistake(self):
        path = self.write("wrong.aps", "x = surface.sense('pressure')\n")
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--controller", path, "--ticks", "10")
        self.assertEqual(status, 2, err)
        self.assertIn("wrong.aps:1", err)

    def test_not_finite_heights_are_clamped_and_counted(self):
        path = self.write("nan.aps", "!register(H)\nH = 0\nH = H / 0\nwhile(1)\n  surface.actuate('height', H)\n"
                                     "  surface.step\nendwhile\n")
        stats = self.folder / "stats.json"
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--controller", path, "--ticks", "20",
                                          "--stats", str(stats))
        self.assertEqual(status, 0, err)
        self.assertEqual(json.loads(stats.read_text())["actuator_values_clamped"], 20 * 64 * 64)


if __name__ == "__main__":
    unittest.main()
