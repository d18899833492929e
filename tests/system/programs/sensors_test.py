"""Each sensor, read by a program, a script and a recording."""
import h5py
import numpy

from programs import *

LUA = (ROOT / "scripts/examples/sensors.lua").read_text()
READER = """
!register(R, B, T, H, P, L)
for(i, 0, 65)
  surface.step
endfor
R = surface.sense('colour.r')
B = surface.sense('colour[2]')
T = surface.sense('object_type')
H = surface.sense('camera_height[3]')
P = surface.sense('pressure')
L = surface.sense('light')
println(globalsum(R), ' ', globalsum(B), ' ', globalsum(T), ' ', globalmax(H), ' ', globalsum(P), ' ', globalsum(L))
"""


class Sensors(ProgramTest):
    def test_program_readings_equal_recorded_ones(self):
        lua = self.write("all.lua", LUA + "\nrecord { sensors = true }\n")
        aps, h5 = self.write("read.aps", READER), str(self.folder / "all.h5")
        surface = self.start(SMARTSURF, "run", lua, "--shm", self.shm, "--record", h5, "--ticks", "70")
        self.wait_for(self.segment().exists, "the segment")
        status, out, err = self.finish(self.start(APRON, "run", aps, "--shm", self.shm))
        self.assertEqual(status, 0, err)
        surface.terminate()
        self.finish(surface)
        read = [float(x) for x in out.split()]
        with h5py.File(h5) as f:
            frame = {name: f["sensors"][name][65] for name in f["sensors"]}
        self.assertEqual(frame["colour"].shape, (16, 16, 3))
        self.assertEqual(frame["camera"].shape, (16, 16, 12))
        expected = [frame["colour"][..., 0].sum(), frame["colour"][..., 2].sum(), frame["object_type"].sum(),
                    frame["camera_height"][..., 3].max(), frame["pressure"].sum(), frame["light"].sum()]
        numpy.testing.assert_allclose(read, expected, rtol=1e-4)
        self.assertEqual(set(numpy.unique(frame["object_type"])), {0.0, 1.0, 2.0})
        self.assertEqual((frame["object_type"] == 2).sum(), (frame["colour"][..., 2] == 1).sum())

    def test_pressure_equals_weight_and_noise_changes_readings(self):
        status, out, err = self.run_program(SMARTSURF, "run", self.write("all.lua", LUA), "--no-controller",
                                            "--set", "noise=0.1")
        self.assertEqual(status, 0, err)
        weight, by_mass = (float(x) for x in re_numbers(out.splitlines()[0]))
        self.assertAlmostEqual(weight, by_mass, delta=0.01 * by_mass)
        true, read = re_numbers(out.splitlines()[1])
        self.assertNotEqual(true, read)
        self.assertLess(abs(true - read), 0.6)

    def test_script_reads_channels_of_many_components(self):
        for sensor, channel, count in (("camera { resolution = 4 }", "camera", 48), ("skin_height { resolution = 8 }", "skin_height", 64)):
            lua = self.write("many.lua", f"surface {{ rows = 6, columns = 6, skin = {{}}, sensors = {{ {sensor} }} }}\n"
                             "on_tick(function() local n, sum = 0, 0 for r = 1, 6 do for c = 1, 6 do\n"
                             f"for _, read in ipairs {{ 'sense', 'truth' }} do local all = {{ cells[read](cells, '{channel}', r, c) }}\n"
                             "n = n + #all end end end print(n) end)")
            status, out, err = self.run_program(SMARTSURF, "run", lua, "--no-controller", "--ticks", "2")
            self.assertEqual((status, out.split()), (0, [str(72 * count)] * len(out.split())), err)

    def test_invalid_tables_report_file_and_line(self):
        table = "surface { rows = 8, columns = 8, sensors = { proximity { calibration = 'c.csv' } } }\n"
        self.write("c.csv", "row,column,channel,gain,offset\n1,1,proximity,1,0\n1,8,proximity,1,0\n")
        self.write("f.csv", "row,column,channel,fault,value\n1,1,proximity,bent,1\n")
        for text, facts in [(table, ("c.csv:3:", "column", "'8'", "0 to 7")),
                            (table.replace("c.csv", "none.csv"), ("wrong.lua:1:", "none.csv", "does not exist")),
                            ("surface { rows = 8, columns = 8, sensors = { proximity {} } }\nfaults { map = 'f.csv' }",
                             ("f.csv:2:", "bent", "stuck_low"))]:
            path = self.write("wrong.lua", text)
            for command in (["check", path], ["run", path, "--no-controller", "--ticks", "1"]):
                status, _, err = self.run_program(SMARTSURF, *command)
                self.assertEqual(status, 2, err)
                self.assertEqual(len(err.strip().splitlines()), 1, err)
                for fact in facts:
                    self.assertIn(fact, err)


def re_numbers(line):
    return [float(word.rstrip(",")) for word in line.split() if word.rstrip(",").replace(".", "", 1).isdigit()]


if __name__ == "__main__":
    unittest.main()
