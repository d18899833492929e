#!/usr/bin/env python3
"""Each mechanism of the paper, driven by an APRON program, moves objects as the paper describes."""
import math
import re
import shutil
import sys
import unittest.mock

from programs import *


class Mechanisms(ProgramTest):
    def run_example(self, name, seconds):
        """Runs the example and returns the numbers that it prints at its end, in order."""
        base = str(ROOT / "scripts/examples" / name)
        status, out, err = self.run_program(SMARTSURF, "run", base + ".lua", "--controller", base + ".aps", "--headless",
                                            "--until", str(seconds))
        self.assertEqual(status, 0, err)
        return [float(number) for number in re.findall(r"-?\d+\.\d+", out)]

    def test_pins_roll_ball_and_stall_under_weight(self):
        ball, light, heavy = self.run_example("pin", 1.5)
        self.assertGreater(ball, 0.2)
        self.assertGreater(light, 1.9)
        self.assertLess(abs(heavy), 0.1)

    def test_balls_carry_parcel(self):
        east, north = self.run_example("ball", 3)
        self.assertGreater(east, 4.0)
        self.assertLess(abs(north), 0.2)

    def test_wheels_redirect_parcels(self):
        places = self.run_example("wheels", 3.7)
        for x in places[0::2]:
            self.assertGreater(x, 11.0)
        self.assertGreater(places[-1], 16.0)  # straight to the lane, then north

    def test_parts_are_recognised_by_their_outline_and_parted(self):
        places = self.run_example("recognise", 10)
        for disc in places[0:4:2]:
            self.assertGreater(disc, 40.0)
        for triangle in places[4:8:2]:
            self.assertLess(triangle, 10.0)

    def test_rotors_move_object(self):
        self.assertGreater(self.run_example("rotor", 3)[0], 3.0)

    def test_force_field_aligns_rod(self):
        distance, turned = self.run_example("force_field", 9)
        self.assertLess(abs(distance), 0.5)
        self.assertLess(abs(turned), 0.1)

    def test_magnets_attract_one_pole_and_repel_the_other(self):
        pulled, _, pushed, _, plain_x, plain_y = self.run_example("magnet", 3)
        self.assertGreater(pulled, 6.5)
        self.assertGreater(pushed, 11.0)
        self.assertEqual((plain_x, plain_y), (2.0, 12.0))

    def test_magnetic_widgets_reach_positions_and_resist_finger(self):
        slider, knob, held, let_go = self.run_example("widgets", 7)
        self.assertAlmostEqual(slider, 10, delta=0.5)
        self.assertAlmostEqual(knob, 90, delta=8)
        self.assertLess(abs(held), 0.2)
        self.assertGreater(let_go, 1)

    def test_joints_hold_a_panel_of_widgets(self):
        example = str(ROOT / "scripts/examples/joints.lua")
        status, out, err = self.run_program(SMARTSURF, "run", example, "--no-controller", "--headless", "--until", "4")
        self.assertEqual(status, 0, err)
        slider, rest, knob, back, bell = [float(number) for number in re.findall(r"-?\d+\.\d+", out)]
        self.assertGreater(slider, 1.0)
        self.assertEqual(slider, rest)
        self.assertGreater(knob, 20)
        self.assertLess(abs(back), 3)
        self.assertGreater(bell, 0.5)

    def test_finger_with_magnet_feels_button(self):
        over, beside = self.run_example("finger", 6.5)
        self.assertGreater(over, 3 * beside)
        self.assertGreater(over, 0.2)

    def test_air_carries_sheet_without_contact(self):
        x, y, lowest = self.run_example("air_jet", 6)
        self.assertLess(abs(x - 9.5) + abs(y - 9.5), 3.0)
        self.assertGreater(lowest, 0.2)

    def test_air_moves_each_type_to_its_region(self):
        letter_x, letter_y, card_x, card_y, lowest = self.run_example("air_types", 12)
        self.assertLess(abs(letter_x - 23) + abs(letter_y - 9.5), 3)
        self.assertLess(abs(card_x - 6) + abs(card_y - 9.5), 3)
        self.assertGreater(lowest, 0.2)

    def test_air_recognises_sheets_by_their_outline(self):
        letter_x, letter_y, disc_x, disc_y, lowest = self.run_example("air_shapes", 20)
        self.assertLess(abs(letter_x - 37) + abs(letter_y - 25), 5)
        self.assertLess(abs(disc_x - 10) + abs(disc_y - 9), 5)
        self.assertGreater(lowest, 0.2)

    def test_confusion_table_has_a_row_for_each_kind(self):
        try:
            import h5py  # noqa: F401
        except ImportError:
            self.skipTest("h5py is not installed")
        file = self.folder / "confusion.md"
        done = subprocess.run([sys.executable, ROOT / "scripts/tasks/confusion", "--seeds", "1", "--first", "1", "--smartsurf", SMARTSURF,
                               "--out", file], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = [[cell.strip() for cell in line.split("|")[1:3]] for line in file.read_text().splitlines()[2:]]
        self.assertEqual([kind for kind, _ in rows], ["letter", "card", "frame", "disc", "triangle"])
        for kind, right in rows:
            self.assertRegex(right, r"^1 \(0\.\d\d…1\.00\)$", kind)

    def test_loaded_bodies_right_themselves_and_tip(self):
        base = str(ROOT / "scripts/examples/loaded.lua")
        for engine in ["native"] + ["bullet"] * has_bullet():
            status, out, err = self.run_program(SMARTSURF, "run", base, "--headless", "--no-controller", "--until", "12", "--engine",
                                                engine)
            self.assertEqual(status, 0, err)
            ball, capsule, stays, falls = (float(number) for number in re.findall(r"-?\d+\.\d+", out))
            # Rolling friction of 0.1 and a gap of 0.2 between two tops hold a tilt of up to (0.1 · 1 + 0.1) / 0.6.
            self.assertGreater(min(ball, capsule), 0.94)
            self.assertAlmostEqual(stays, 4.25, delta=0.02)
            self.assertLess(falls, 3.5)

    def test_robot_descriptions_move_by_their_closed_forms(self):
        base = str(ROOT / "scripts/examples/models.lua")
        status, out, err = self.run_program(SMARTSURF, "run", base, "--headless", "--no-controller", "--until", "8")
        self.assertEqual(status, 0, err)
        period, expected, opened, hangs = (float(number) for number in re.findall(r"-?\d+\.\d+", out))
        self.assertAlmostEqual(period / expected, 1.0, delta=1e-3)
        self.assertAlmostEqual(opened, 20.0, delta=0.1)
        self.assertAlmostEqual(hangs, 20.8, delta=0.3)  # stiffness · angle = 0.777 N·m · cos(angle)

    def test_urdf_drawer_slides_down_a_slope(self):
        # On 30°, against friction f and damping c: v = F/c·(1 − exp(−c·t/m)), F = m·g·sin 30° − f.
        shutil.copy(ROOT / "scripts/examples/models/drawer.urdf", self.folder)
        (self.folder / "slope.lua").write_text(
            "world { unit = 'cm', control_period = 0.05, dt = 1 / 400 }\n"
            "surface { rows = 16, columns = 16, pitch = 4, actuator = pin { top = 3.6 }, tilt = { 0, 30 } }\n"
            "local drawer = urdf { file = 'drawer.urdf', position = { 30, 30, 0 }, fixed = true }\n"
            "on_finish(function() print(joint(drawer.joints.rail):coordinate()) end)\n")
        m, c, t = 0.8, 0.5, 0.25
        force = m * 9.81 / 2 - 2
        expected_cm = 100 * (force / c * t - force * m / c**2 * (1 - math.exp(-c * t / m)))
        for engine in ["native"] + ["bullet"] * has_bullet():
            status, out, err = self.run_program(SMARTSURF, "run", str(self.folder / "slope.lua"), "--headless", "--no-controller",
                                                "--until", str(t), "--engine", engine)
            self.assertEqual(status, 0, err)
            self.assertAlmostEqual(float(out.split()[0]) / expected_cm, 1.0, delta=5e-3)  # half a substep of acceleration

    def test_every_system_of_the_paper_has_an_example(self):
        page = (ROOT / "docs/actuators.md").read_text()
        rows = re.findall(r"^\| \[([1-7])\] .*\|([^|]*)\|$", page, re.M)
        self.assertEqual([number for number, _ in rows], list("1234567"))
        here = pathlib.Path(__file__).read_text()
        for _, examples in rows:
            named = [name for name in re.findall(r"`(\w+)`", examples) if (ROOT / f"scripts/examples/{name}.aps").exists()]
            self.assertGreaterEqual(len(named), 1, examples)
            for name in named:
                self.assertIn(f'run_example("{name}"', here)

    def test_wave_carries_plate_against_its_direction(self):
        self.assertGreater(self.run_example("tile", 3)[0], 2.0)

    def test_tips_roll_pocket_and_lift(self):
        ball, marble, crate = self.run_example("tips", 3)
        self.assertGreater(ball, 3.0)
        # (R - d cos 40°) / sin 40°
        self.assertAlmostEqual(marble, (0.6 - 0.5**0.5 * 0.766044) / 0.642788, delta=0.005)
        self.assertAlmostEqual(crate, 1.5, delta=0.005)

    def test_tilting_tiles_gather_ball_and_hold_crate(self):
        ball, crate = self.run_example("tilt", 10)
        self.assertLess(ball, 2.0)
        self.assertGreater(crate, 5.0)

    def test_delta_robots_walk_plate_to_goal(self):
        distance, height = self.run_example("delta", 12)
        self.assertLess(distance, 1.0)
        self.assertGreater(height, 1.3)

    def test_skin_carries_apple_along_circle(self):
        turns, distance = self.run_example("skin", 15)
        self.assertGreater(turns, 0.8)
        self.assertGreater(distance, 1.0)
        self.assertLess(distance, 5.0)

    def test_mixed_surface_on_slope(self):
        status, out, err = self.run_program(SMARTSURF, "run", str(ROOT / "scripts/examples/mixed.lua"), "--no-controller",
                                            "--headless", "--until", "4")
        self.assertEqual(status, 0, err)
        self.assertGreater(float(re.search(r"-?\d+\.\d+", out)[0]), 5.0)

    def test_all_actuator_channels_are_recorded(self):
        base = str(ROOT / "scripts/examples/wheels")
        experiment = self.write("recorded.lua", pathlib.Path(base + ".lua").read_text() + "\nrecord { actuators = true }\n")
        recording = str(self.folder / "wheels.h5")
        status, _, err = self.run_program(SMARTSURF, "run", experiment, "--controller", base + ".aps", "--headless",
                                          "--ticks", "5", "--record", recording)
        self.assertEqual(status, 0, err)
        import h5py
        with h5py.File(recording) as file:
            self.assertEqual(sorted(file["actuators"]), ["spin_a", "spin_b"])
            last = file["actuators/spin_b"][-1]
            self.assertEqual((last[0, 0], last[0, 15]), (-10.0, 10.0))


    def test_controller_command_attaches_to_its_surface(self):
        surface = self.write("pin.lua", "surface { rows = 4, columns = 4, actuator = pin { max_speed = 2 } }\n"
                             "sphere { radius = 1, position = {1.5, 1.5, 1} }\n"
                             "on_finish(function() print(string.format('%.1f', select(3, object(0):position()))) end)")
        program = self.write("up.aps", "while(1)\nsurface.actuate('height', 2)\nsurface.step\nendwhile\n")
        status, out, err = self.run_program(SMARTSURF, "run", surface, "--controller", f"{APRON} run {program}",
                                            "--headless", "--until", "2")
        self.assertEqual((status, out), (0, "3.0\n"), err)

    def test_occupancy_reports_masked_cells(self):
        surface = self.write("masked.lua", """
surface { rows = 6, columns = 8, actuator = pin { max_speed = 2 }, mask = function(row, column) return not (row >= 5 and column >= 6) end }
sphere { radius = 1, position = {2, 3, 1} }
on_finish(function() print(string.format('%.3f', select(3, object(0):position()))) end)""")
        program = self.write("masked.aps", """!register(HERE)
while(1)
  HERE = surface.sense('occupancy')
  surface.actuate('height', HERE * globalsum(HERE) / 14)
  surface.step
endwhile
""")
        status, out, err = self.run_program(SMARTSURF, "run", surface, "--controller", program, "--headless", "--until", "4")
        self.assertEqual(status, 0, err)
        self.assertAlmostEqual(float(out), 1 + 42 / 14, delta=0.01)   # the mask leaves 42 cells

    def test_python_controller_reads_occupancy_of_free_layout(self):
        surface = self.write("free.lua", """
surface { rows = 2, columns = 3, positions = {{0, 2}, false, {2, 2, 0.5}, {0, 0}, {1, 0.5}, false},
          sensors = { proximity {} } }""")
        controller = self.write("controller.py", """
import sys, numpy, shm_protocol
with shm_protocol.Controller(sys.argv[1], timeout=10) as table:
    while table.wait():
        here = table.sensors["occupancy"].copy()
        table.actuators["height"] = 2 * here
        table.publish()
print(here.tolist(), table.description.positions.shape)
""")
        client = {"PYTHONPATH": str(ROOT / "shm-protocol/python"),
                  "SHM_PROTOCOL_LIBRARY": str(next(BIN.parent.glob("lib*/**/libshm_protocol_c.so.1")))}
        with unittest.mock.patch.dict(os.environ, client):
            status, out, err = self.run_program(SMARTSURF, "run", surface, "--controller",
                                                f"{sys.executable} {controller} {{shm}}", "--headless", "--ticks", "3")
        self.assertEqual(status, 0, err)
        self.assertIn("[[1.0, 0.0, 1.0], [1.0, 1.0, 0.0]] (2, 3, 3)", out)

    def test_sensor_name_occupancy_is_reserved(self):
        surface = self.write("masked.lua", "surface { rows = 2, columns = 2, mask = {{true, false}, {true, true}}, "
                             "sensors = { proximity { name = 'occupancy' } } }")
        status, _, err = self.run_program(SMARTSURF, "run", surface, "--controller", "none.aps", "--headless")
        self.assertEqual((status, err.count("\n")), (2, 1), err)

    @needs_view
    def test_hexagonal_recording_replays_identically(self):
        surface = self.write("hex.lua", """
surface { rows = 5, columns = 6, layout = 'hex', actuator = wheels {} }
box { size = {2, 2, 1}, position = {3, 2, 0.5} }
on_tick(function() for r = 1, 5 do for c = 1, 6 do cells:target('spin_a', r, c, 5) end end end)""")
        status, _, err = self.run_program(SMARTSURF, "run", surface, "--no-controller", "--headless", "--until", "0.5",
                                          "--record", "hex.h5", "--screenshot", "run.png@0.5", *SMALL_PICTURE)
        self.assertEqual(status, 0, err)
        status, _, err = self.run_program(SMARTSURF, "replay", "hex.h5", "--screenshot", "replay.png@0.5", *SMALL_PICTURE)
        self.assertEqual(status, 0, err)
        # Poses are recorded with the precision of the drawing, so the pictures are bit-identical.
        self.assertEqual((self.folder / "run.png").read_bytes(), (self.folder / "replay.png").read_bytes())


if __name__ == "__main__":
    unittest.main()
