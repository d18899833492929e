"""smartsurf identify: finds what a recorded table has and an experiment does not say."""
import importlib.machinery
import importlib.util
import random
import sys
import types
import unittest
import unittest.mock

from programs import *

os.environ.setdefault("SMARTSURF_PYTHON", sys.executable)
HAS_ALL = all(importlib.util.find_spec(name) for name in ("h5py", "scipy")) and (BIN.parent / "python/smartsurf").is_dir()


def load_blind():
    loader = importlib.machinery.SourceFileLoader("blind", str(ROOT / "scripts/hardware/blind"))
    blind = importlib.util.module_from_spec(importlib.util.spec_from_loader("blind", loader))
    loader.exec_module(blind)
    return blind


PUBLIC = """
world {{ control_period = 0.01, dt = 0.005, seed = 3 }}
surface {{ rows = {rows}, columns = 4, actuator = pin {{ range = {{0, 5}}, max_speed = 10, max_acceleration = 150 }},
          sensors = {{ pin_height {{}} }} }}
record {{ sensors = true, actuators = {actuators} }}
local heights, left = {{}}, {{}}
on_tick(function()
  for cell = 1, cells.rows * cells.columns do
    left[cell] = (left[cell] or 0) - 1
    if {moves} and left[cell] <= 0 then
      local small = random() < 0.5
      heights[cell] = small and math.min(4.5, math.max(0.5, (heights[cell] or 2) + random(-0.3, 0.3))) or random(0.5, 4.5)
      left[cell] = small and random(3, 15) or random(20, 60)
    end
    heights[cell] = heights[cell] or 0
  end
  cells:targets('height', heights)
end)
at(3, quit)
"""


def public(rows=4, actuators="true", moves="true"):
    return PUBLIC.format(rows=rows, actuators=actuators, moves=moves)


@unittest.skipUnless(HAS_ALL, "needs h5py, SciPy and the Python package")
class IdentifiedLive(ProgramTest):
    """Answers come late, frames are lost, and boards miss ticks: where a reading is given, its cell's commands are those that were in force."""
    SETTLES = 30

    def recording(self, draw, frames=600, columns=4):
        """Writes live.h5; returns what was in force from each frame on, frames × cells."""
        import h5py
        import numpy as np
        answers = np.zeros((frames, columns))
        for cell in range(columns):
            for tick in range(1, frames):
                answers[tick, cell] = draw.uniform(0, 4) if draw.random() < 0.04 else answers[tick - 1, cell]
        seen, late, tick = np.ones(frames, bool), np.zeros((frames, 2), int), 30
        while tick < frames - 1:
            if draw.random() < 0.02:  # the host is suspended after this frame, and its answer to it may be late
                length = draw.randint(1, 6)
                seen[tick + 1:tick + 1 + length] = False
                late[tick] = draw.randint(0, length)
                tick += length
            elif draw.random() < 0.03:
                late[tick, draw.randrange(2)] = draw.randint(1, 3)
            tick += 1
        follows = np.zeros((frames, 2), int)  # the newest answer that has come by each frame
        for board in range(2):
            for tick in np.flatnonzero(seen):
                follows[min(tick + 1 + late[tick, board], frames):, board] = tick
        board_of = np.repeat([0, 1], columns // 2)
        in_force = np.array([[answers[follows[t, board_of[c]], c] for c in range(columns)] for t in range(frames)])
        valid = np.array([[draw.random() > 0.02 for _ in range(2)] for _ in range(frames)])
        stale = np.array([[draw.random() < 0.01 for _ in range(2)] for _ in range(frames)]) & valid
        ticks = np.flatnonzero(seen)
        with h5py.File(self.folder / "live.h5", "w") as file:
            file.create_group("meta").attrs.update({"format": "smartsurf-recording", "control_period_s": 0.01})
            file.create_group("surface").attrs.update({"rows": 1, "columns": columns, "pitch": 1.0})
            file["clock/host_ns"] = ticks * 10_000_000
            file["tick"], file["answers/tick"] = ticks, ticks
            file["actuators/height"] = answers[ticks][:, None, :].astype(np.float32)
            file["sensors/pin_height"] = (1 + ticks)[:, None, None] * np.ones((1, 1, columns), np.float32)
            file["sensors/valid"] = valid[ticks][:, board_of][:, None, :].astype(np.uint8)
            file["boards/valid"] = valid[ticks].astype(np.uint32)
            file["boards/tick"] = (1000 + ticks[:, None] - stale[ticks]).astype(np.uint32)
            file["boards/in_force"] = follows[np.maximum(ticks[:, None] - stale[ticks], 0), [0, 1]].astype(np.uint32)
        return in_force, stale[:, board_of]

    def test_commands_are_known_where_readings_are(self):
        import numpy as np
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf._recorded import read
        known = of = 0
        for seed in range(12):
            in_force, stale = self.recording(random.Random(seed))
            recorded = read(self.folder / "live.h5")
            commands, readings = recorded.commands["height"][:, 0], recorded.readings["pin_height"][:, 0]
            last = len(commands)
            # A board senses before it follows: commands of the tick that ends with a frame move it from that frame on.
            wrong = np.abs(commands - in_force[:last]) > 1e-6
            for frame, cell in np.argwhere(np.isfinite(readings)):
                if frame <= self.SETTLES:
                    continue
                self.assertFalse(wrong[frame - self.SETTLES:frame, cell].any(), f"seed {seed}, frame {frame}, cell {cell}")
                self.assertFalse(stale[frame, cell], f"seed {seed}, frame {frame}, cell {cell}")
            known += np.isfinite(readings).sum()
            of += readings.size
        self.assertGreater(known, 0.2 * of)


class LaggingPins(ProgramTest):
    def test_a_pin_with_a_lag_follows_its_closed_form(self):
        import h5py
        import numpy as np
        draw = random.Random(2)
        for _ in range(3):
            lag, target, gain, offset = draw.uniform(0.01, 0.2), draw.uniform(1, 2.5), draw.uniform(0.8, 1.2), draw.uniform(0, 0.3)
            self.write("faults.csv", f"row,column,channel,fault,value\n0,0,height,gain,{gain}\n0,0,height,offset,{offset}\n1,1,height,late,3\n")
            script = self.write("lag.lua", f"""world {{ control_period = 0.01, dt = 0.005 }}
                surface {{ rows = 2, columns = 2, actuator = pin {{ range = {{0, 4}}, max_speed = 1e4, max_acceleration = 1e6, lag = {lag} }},
                          sensors = {{ pin_height {{}} }} }}
                faults {{ map = 'faults.csv' }}
                record {{ sensors = true, actuators = true }}
                on_tick(function() for row = 1, 2 do for column = 1, 2 do cells:target('height', row, column, {target}) end end end)""")
            status, _, err = self.run_program(SMARTSURF, "run", script, "--no-controller", "--headless", "--ticks", "60", "--record", "lag.h5")
            self.assertEqual(status, 0, err)
            with h5py.File(self.folder / "lag.h5") as file:
                height, commands = file["sensors/pin_height"][:], file["actuators/height"][:]
            begin = int(np.flatnonzero(commands[:, 0, 1] > 0)[0]) - 1  # the last frame at rest
            part = 1 - np.exp(-0.01 * np.arange(len(height) - begin) / lag)
            np.testing.assert_allclose(height[begin:, 0, 1], target * part, atol=2e-5)
            # With gain and offset, from the height of the lowest command; late by three ticks.
            np.testing.assert_allclose(height[begin:, 0, 0], offset + gain * target * part, atol=2e-5)
            np.testing.assert_allclose(height[begin + 3:, 1, 1], height[begin:-3, 0, 1], atol=1e-6)


@unittest.skipUnless(HAS_ALL, "needs SciPy, h5py and the Python package")
class Identification(ProgramTest):
    def record(self, name, script, *flags):
        path = self.write(f"{name}.lua", script)
        status, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--headless", "--record", f"{name}.h5", *flags)
        self.assertEqual(status, 0, err)
        return f"{name}.h5"

    def identify(self, *words):
        return self.run_program(SMARTSURF, "identify", *words)

    def refused(self, expected, *words):
        status, _, err = self.identify(*words)
        self.assertEqual(status, 2, err)
        self.assertRegex(err, r"\Asmartsurf identify: [^\n]*\n\Z")
        self.assertIn(expected, err)
        self.assertFalse((self.folder / "identified.lua").exists())

    def test_seconds_are_above_0(self):
        for value in ("0", "-1", "nan", "inf", "long"):
            self.refused(f"--seconds: {value}: must be a finite number above 0", "run.h5", "--experiment", "table.lua", "-o", "identified.lua",
                         "--seconds", value)

    def test_a_secret_table_is_found(self):
        draw = random.Random(5)
        speed, acceleration, lag, noise = draw.uniform(5, 8), draw.uniform(70, 140), draw.uniform(0.015, 0.03), draw.uniform(0.004, 0.01)
        cells = [(r, c, draw.uniform(0.93, 1.04), draw.uniform(-0.1, 0.1), draw.randrange(4)) for r in range(4) for c in range(4)]
        rows = ["row,column,channel,fault,value"]
        for r, c, gain, offset, delay in cells[:-3]:
            rows += [f"{r},{c},height,gain,{gain}", f"{r},{c},height,offset,{offset}", f"{r},{c},height,late,{delay}"]
        rows += ["3,2,height,stuck,2.5", "3,3,pin_height,dead,"]
        self.write("secret.csv", "\n".join(rows) + "\n")
        table = public(moves="(cell ~= 14 or time() > 2.95)")  # one cell moves as the recording ends
        # Functions of the script that need what another one has done in every tick.
        table += "local last\non_tick(function() last = { time() } end)\nevery(0.5, function() return last[1] end)\non_finish(function() metric('last', last[1]) end)\n"
        recording = self.record("secret", table + "faults { map = 'secret.csv' }\n", *(
            word for name, value in (("actuator.max_speed", speed), ("actuator.max_acceleration", acceleration), ("actuator.lag", lag),
                                     ("sensor.pin_height.noise", noise), ("sensor.pin_height.dropout", 0.01)) for word in ("--vary", f"{name}={value}")))
        self.write("public.lua", table)
        status, out, err = self.identify(recording, "--experiment", "public.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        found = json.loads((self.folder / "identified.json").read_text())

        def near(value, error, truth):
            self.assertLess(abs(value - truth), 4 * error + 1e-9)
            self.assertLess(error, 0.05 * abs(truth) + 0.01)
        for name, truth in (("max_speed", speed), ("max_acceleration", acceleration), ("lag", lag)):
            near(*found["parameters"][f"actuator.{name}"].values(), truth)
        near(*found["parameters"]["sensor.pin_height.noise"].values(), noise)
        self.assertLess(abs(found["parameters"]["sensor.pin_height.dropout"]["value"] - 0.01), 0.005)
        of = found["cells"]
        self.assertEqual(of["state"][3], [0, 3, 1, 2])
        for r, c, gain, offset, delay in cells[:-3]:
            near(of["gain"][r][c], of["gain_error"][r][c], gain)
            near(of["offset"][r][c], of["offset_error"][r][c], offset)
            self.assertEqual(of["delay"][r][c], delay)
        # The identified experiment runs, and does what the recorded table did.
        status, _, err = self.run_program(SMARTSURF, "run", "identified.lua", "--no-controller", "--headless", "--record", "again.h5")
        self.assertEqual(status, 0, err)
        import h5py
        with h5py.File(self.folder / recording) as a, h5py.File(self.folder / "again.h5") as b:
            apart = abs(a["surface/height"][:] - b["surface/height"][:])[:, :3]
        self.assertLess((apart ** 2).mean() ** 0.5, 0.01)
        self.assertIn("± ", out)
        self.assertIn("<svg", (self.folder / "identified.svg").read_text())

    def test_a_draw_that_a_busy_machine_spoilt_is_recorded_again(self):
        blind, recorded = load_blind(), []

        def record(*_):
            recorded.append(1)
            if len(recorded) < 3:
                raise blind.Busy("busy")
        blind.record_live, blind.run, blind.compare = record, lambda *_, **__: "", lambda *_: "compared"
        self.write("identified.json", "{}")
        self.assertEqual(blind.identify_one(6, blind.draw(6), types.SimpleNamespace(simulated=False, seconds=1), self.folder), "compared")
        self.assertEqual(len(recorded), 4)  # cells three times, then the ball

    def test_no_cell_stops_in_a_minimum_beside_its_own(self):
        # One cell of this draw has such a minimum, a tick later and with another gain.
        blind = load_blind()
        secret = blind.draw(6)
        self.write("identify.lua", blind.PUBLIC.read_text())
        values, _ = blind.write_secret(secret, self.folder)
        status, _, err = self.run_program(SMARTSURF, "run", "secret.lua", "--no-controller", "--headless", "--seed", str(secret["seed"]), "--set", "seconds=8",
                                          *(word for name, value in values.items() for word in ("--vary", f"{name}={value!r}")), "--record", "cells.h5")
        self.assertEqual(status, 0, err)
        status, _, err = self.identify("cells.h5", "--experiment", "identify.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        cells = json.loads((self.folder / "identified.json").read_text())["cells"]
        for r, c in ((r, c) for r in range(1, 9) for c in range(1, 9) if cells["state"][r][c] == 0):
            self.assertEqual(cells["delay"][r][c], secret["delay"][r][c], (r, c))
            self.assertLess(abs(cells["gain"][r][c] - secret["gain"][r][c]), 5 * cells["gain_error"][r][c], (r, c))

    def test_a_secret_ball_is_found(self):
        draw = random.Random(8)
        secret = {"rolling_friction": draw.uniform(0.03, 0.12), "restitution": draw.uniform(0.25, 0.55)}
        self.write("table.lua", (ROOT / "scripts/hardware/identify.lua").read_text())
        varied = {f"object.ball.{name}": value for name, value in secret.items()} | {"sensor.proximity.noise": 0.02, "sensor.pressure.noise": 0.05}
        status, _, err = self.run_program(SMARTSURF, "run", "table.lua", "--no-controller", "--headless", "--set", "drive=ball", "--set", "seconds=3",
                                          "--record", "ball.h5", *(word for name, value in varied.items() for word in ("--vary", f"{name}={value}")))
        self.assertEqual(status, 0, err)
        status, _, err = self.identify("ball.h5", "--experiment", "table.lua", "-o", "identified.lua", "--object", "ball",
                                       "--fit", "restitution,rolling_friction")
        self.assertEqual(status, 0, err)
        found = json.loads((self.folder / "identified.json").read_text())["parameters"]
        for name, truth in secret.items():
            value, error = found[f"object.ball.{name}"].values()
            self.assertLess(abs(value - truth), 0.03 * truth, name)
            self.assertLess(error, 0.03 * truth, name)

    def test_nothing_follows_from_a_rerun_that_strays(self):
        table = (ROOT / "scripts/hardware/identify.lua").read_text()
        self.write("table.lua", table)
        self.record("elsewhere", table.replace("velocity = { 1.8, 1.5, 0 }", "velocity = { 1.8, 0.9, 0 }"), "--set", "drive=ball", "--set", "seconds=2",
                    "--vary", "sensor.proximity.noise=0.02")
        status, out, err = self.identify("elsewhere.h5", "--experiment", "table.lua", "-o", "identified.lua", "--object", "ball",
                                         "--fit", "rolling_friction")
        self.assertEqual(status, 0, err)
        self.assertRegex(out, r"rolling_friction +not identified: the re-run strays from the object, by \d")

    def test_a_live_recording_with_lost_frames_says_the_same(self):
        """Of a simulated one: the commands of a live frame answer it, and those of lost frames are not known."""
        import h5py
        import numpy as np
        draw = random.Random(8)
        truth = {"max_speed": draw.uniform(5, 8), "max_acceleration": draw.uniform(70, 140), "lag": draw.uniform(0.015, 0.03)}
        text = public().replace("left[cell] or 0", "left[cell] or 100").replace("at(3,", "at(8,")
        self.record("table", text, *(word for name, value in (*((f"actuator.{name}", value) for name, value in truth.items()),
                                                              ("sensor.pin_height.noise", 0.006)) for word in ("--vary", f"{name}={value}")))
        for name, lost in (("busy", 0.6), ("live", 0.04)):
            with h5py.File(self.folder / "table.h5") as whole, h5py.File(self.folder / f"{name}.h5", "w") as live:
                count = len(whole["tick"]) - 1
                keep = np.array([k for k in range(40, count) if draw.random() > lost])
                for group in ("meta", "surface"):
                    whole.copy(group, live)
                live["tick"], live["answers/tick"], live["clock/host_ns"] = (whole["tick"][:][keep] for _ in range(3))
                live["sensors/pin_height"] = whole["sensors/pin_height"][:][keep]
                live["actuators/height"] = whole["actuators/height"][:][keep + 1]
        self.refused("too many frames were lost or late", "busy.h5", "--experiment", "table.lua", "-o", "identified.lua")
        status, _, err = self.identify("live.h5", "--experiment", "table.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        found = json.loads((self.folder / "identified.json").read_text())["parameters"]
        for name, value in truth.items():
            estimate, error = found[f"actuator.{name}"].values()
            self.assertLess(abs(estimate - value), 4 * error + 1e-9, name)
            self.assertLess(error, 0.05 * value, name)

    def test_readings_that_are_not_known_are_no_motion(self):
        import h5py
        import numpy as np
        draw = random.Random(4)
        truth = {"max_speed": draw.uniform(14, 18), "max_acceleration": draw.uniform(250, 400), "lag": draw.uniform(0.03, 0.04)}
        text = public().replace("max_speed = 10, max_acceleration = 150", "max_speed = 20, max_acceleration = 400")
        self.record("table", text, *(word for name, value in (*((f"actuator.{name}", value) for name, value in truth.items()),
                                                              ("sensor.pin_height.noise", 0.006)) for word in ("--vary", f"{name}={value}")))
        with h5py.File(self.folder / "table.h5", "r+") as file:
            readings = file["sensors/pin_height"][:]
            lost = np.random.default_rng(1).random((len(readings) // 10 + 1, *readings.shape[1:])) < 0.12
            readings[np.repeat(lost, 10, axis=0)[:len(readings)]] = np.nan
            file["sensors/pin_height"][:] = readings
        status, _, err = self.identify("table.h5", "--experiment", "table.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        found = json.loads((self.folder / "identified.json").read_text())["parameters"]
        for name, value in truth.items():
            estimate, error = found[f"actuator.{name}"].values()
            self.assertLess(abs(estimate - value), 4 * error, name)
            self.assertLess(error, 0.01 * value, name)

    def test_noise_below_the_resolution_has_an_interval(self):
        import numpy as np
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf._residuals import noise_of_rounded
        random_numbers, held, draws = np.random.default_rng(3), 0, 120
        for _ in range(draws):
            step, sigma = random_numbers.uniform(0.002, 0.01), random_numbers.uniform(0.2, 0.7)
            truth = random_numbers.uniform(0, 1, (150, 20))
            reading = np.rint((truth + random_numbers.normal(0, sigma * step, truth.shape)) / step) * step
            # Each cell's line is off by about as much as the noise.
            line = truth + random_numbers.normal(0, 0.1 * step, 20) + truth * random_numbers.normal(0, 0.1 * step, 20)
            found = noise_of_rounded(reading - line, line, np.ones(truth.shape, bool), step)
            self.assertTrue(found.low < found.value < found.high)
            held += found.low <= sigma * step <= found.high
        self.assertTrue(0.89 * draws <= held <= 0.99 * draws, held)

    def test_false_hits_are_counted_in_all_ticks(self):
        import numpy as np
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf._readings import fit_proximity
        held = 0
        for seed in range(12):
            random_numbers, ideal = np.random.default_rng(seed), np.full((800, 10, 10), 6.0)
            for tick, plane in enumerate(ideal):
                row, column = 4 + round(3 * np.sin(tick / 90)), 4 + round(3 * np.cos(tick / 70))
                plane[row:row + 2, column:column + 2] = 2
            sensed = np.where(ideal < 6, ideal + random_numbers.normal(0, 0.02, ideal.shape), 6)
            sensed[(ideal == 6) & (random_numbers.uniform(size=ideal.shape) < 0.01)] = 3
            found = fit_proximity("proximity", 6, [sensed], [ideal]).values["false_hits"]
            held += found.low <= 0.01 <= found.high
        self.assertGreaterEqual(held, 10)

    def test_noise_of_distances_is_not_that_of_an_object_beside_its_rerun(self):
        import numpy as np
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf._readings import fit_proximity
        row, column = np.mgrid[0:12, 0:12]

        def distances(tick, aside):
            square = (column - 5.5 - 1.5 * np.sin(tick / 60) - aside) ** 2 + (row - 5.5 - 1.5 * np.cos(tick / 80)) ** 2
            return np.where(square < 4, 2.5 - np.sqrt(np.maximum(4 - square, 0)), 3)
        held, draws = 0, 60
        for seed in range(draws):
            random_numbers, ticks = np.random.default_rng(seed), range(60)
            ideal = np.array([distances(tick, 0) for tick in ticks])
            sensed = np.array([distances(tick, 0.2 * np.sin(tick / 70)) for tick in ticks])
            sensed = np.where(sensed < 3, sensed + random_numbers.normal(0, 0.03, sensed.shape), 3)
            found = fit_proximity("proximity", 3, [sensed[:25], sensed[25:]], [ideal[:25], ideal[25:]], follows=False)
            held += found.values["noise"].low <= 0.03 <= found.values["noise"].high
            self.assertIn("strays", found.unknown["bias"])
        self.assertTrue(0.88 * draws <= held, held)

    def test_a_recording_is_of_the_scene_that_follows_its_name(self):
        text = public().replace("on_tick", "if option('load', 0, 'a weight') > 0 then sphere { radius = 1, position = { 1.5, 1.5, 6 }, label = 'load' } end\n"
                                           "on_tick", 1)
        recording = self.record("table", text)
        self.refused("no such object (it has none with a label)", recording, "--experiment", "table.lua", "-o", "identified.lua", "--object", "load")
        # With the option the object is there; no sensor sees it.
        self.refused("no proximity and no pressure sensor sees the object", f"{recording},load=1", "--experiment", "table.lua", "-o",
                     "identified.lua", "--object", "load")
        self.refused("table.lua has no option 'lead' (it has load)", f"{recording},lead=1", "--experiment", "table.lua", "-o", "identified.lua")
        self.refused("1 after the comma must be NAME=VALUE", f"{recording},1", "--experiment", "table.lua", "-o", "identified.lua")

    def test_what_keeps_the_result_from_being_loaded_is_known_before_the_fit(self):
        (self.folder / "out").mkdir()
        recording = self.record("table", public())
        for part, output, expected in (("option('uncertainty', 1, 'of ours')\n", "identified.lua", "option 'uncertainty'"),
                                       ("require 'part'\n", "out/identified.lua", "the files of table.lua must be beside out/identified.lua")):
            self.write("part.lua", "")
            self.write("table.lua", part + public())
            self.refused(expected, recording, "--experiment", "table.lua", "-o", output)
        self.assertEqual(list(self.folder.glob("out/*")), [])

    def test_ranges_wider_than_their_values_stay_possible(self):
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf import _identified
        found = {"actuator.max_acceleration": (50.0, 40.0), "actuator.max_speed": (2.0, 1.5)}
        self.write("identified.lua", _identified.experiment_text(_identified.Original("table.lua", public()), [], {}, found, None))
        for seed in range(3):
            status, _, err = self.run_program(SMARTSURF, "run", "identified.lua", "--set", "uncertainty=3", "--ticks", "2", "--no-controller",
                                              "--seed", str(seed))
            self.assertEqual(status, 0, err)

    def test_what_is_not_identified_again_stays(self):
        import numpy as np
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf import _identified
        from smartsurf._cells import GOOD, IDLE, STUCK, UNSURE
        draw = random.Random(8)
        script = self.write("table.lua", "local p = option('p', 1, '')\n" + public())
        recording = types.SimpleNamespace(path="a\nb.h5")
        for _ in range(20):
            names = [f"object.{draw.choice(['ball', 'Bob' + chr(39) + 's', 'x' + chr(92), 'ä' + chr(10)])}.{p}" for p in ("mass", "friction", "x")]
            found, path, then = {}, pathlib.Path(script), ({}, [])
            delays, of_sensor = np.zeros((4, 4), int), {}
            for step in (1, 2):
                original = _identified.read_original(path)
                self.assertEqual((original.name, original.text, original.values, original.rows), ("table.lua", pathlib.Path(script).read_text(), *then))
                new = {name: (float(draw.randint(1, 9)), 0.5) for name in draw.sample(names, 2)}
                state = np.array(draw.choices([GOOD, IDLE, STUCK, UNSURE], k=16)).reshape(4, 4)
                state[1, 2] = GOOD
                delay = np.array(draw.choices(range(4), k=16)).reshape(4, 4)
                fit = types.SimpleNamespace(state=state, channel="height", gain=np.full((4, 4), float(step)), offset=np.zeros((4, 4)), delay=delay,
                                            level=np.full((4, 4), 2.0))
                latency = int(delay[state == GOOD].min())
                dead = [(r, c, "pin_height", "dead", None) for r, c in [(draw.randrange(4), draw.randrange(4))]]
                rows = _identified.with_earlier_cells(_identified.cell_faults(fit, latency) + dead, original.rows, fit, {"pin_height"},
                                                      int(original.values.get("actuator.latency", (latency, 0))[0]) - latency)
                new["actuator.latency"] = (float(latency), 0.0)
                found = {**found, **new}
                path = self.folder / f"it's {step}.lua"
                path.write_text(_identified.experiment_text(original, [recording], {"p": "a\nb"}, new, f"it's {step}.csv"))
                path.with_suffix(".csv").write_text(_identified.map_text(rows))
                # Each cell is as it was last identified, and never earlier than the others.
                kind = np.where((state == GOOD) | (state == STUCK), state, kind if step > 1 else IDLE)
                delays = np.where(state == GOOD, delay, np.where(kind == GOOD, np.maximum(delays, latency), 0))
                for r, c in np.ndindex(4, 4):
                    of_cell = {row[3]: row[4] for row in rows if row[:3] == (r, c, "height")}
                    expected = {GOOD: {"gain", "offset"} | ({"late"} if delays[r, c] > latency else set()), STUCK: {"stuck"}}.get(kind[r, c], set())
                    self.assertEqual(set(of_cell), expected)
                    self.assertEqual(of_cell.get("late", 0), delays[r, c] - latency if kind[r, c] == GOOD else 0)
                self.assertEqual([row for row in rows if row[2] == "pin_height"], dead)
                then = (found, rows)
        status, _, err = self.run_program(SMARTSURF, "run", str(path), "--no-controller", "--headless", "--ticks", "2")
        self.assertEqual(status, 0, err)

    def test_the_result_is_of_the_options_of_the_recording(self):
        table = public().replace("range = {0, 5}", "range = {option('low', 0, 'lowest height'), 5}").replace("{rows}", "4")
        table = table.replace("heights[cell] or 0", "heights[cell] or -2").replace("random(0.5, 4.5)", "random(-2.5, 4.5)")
        self.write("stuck.csv", "row,column,channel,fault,value\n1,2,height,stuck,-2.5\n")
        recording = self.record("table", table + "faults { map = 'stuck.csv' }\n", "--set", "low=-3", "--vary", "sensor.pin_height.noise=0.01")
        self.write("public.lua", table)
        status, _, err = self.identify(recording, "--experiment", "public.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        self.assertRegex((self.folder / "identified.csv").read_text(), r"\n1,2,height,stuck,-2\.(49|5)")
        self.assertIn("-- There with --set low=-3\n", (self.folder / "identified.lua").read_text())
        (self.folder / "identified.lua").rename(self.folder / "first.lua")
        self.refused("is of another table", f"{recording},low=0", "--experiment", "public.lua", "-o", "identified.lua")
        # Identification of the same recording gives the same result.
        (self.folder / "identified.csv").rename(self.folder / "first.csv")
        first = (self.folder / "first.lua").read_text().replace("identified.csv", "first.csv")
        (self.folder / "first.lua").write_text(first)
        status, _, err = self.identify(recording, "--experiment", "first.lua", "-o", "Anna's.lua")
        self.assertEqual(status, 0, err)
        lines = (self.folder / "Anna's.lua").read_text().splitlines()
        self.assertEqual(lines[2:4], ["-- Then with what it has found in table.h5.", "-- There with --set low=-3"])
        self.assertEqual([line.replace("Anna\\'s", "first") for line in lines[:2] + lines[4:]], first.splitlines())
        self.assertEqual((self.folder / "Anna's.csv").read_text(), (self.folder / "first.csv").read_text())

    def of_own_table(self, name, *words):
        """Identifies a recording of scripts/hardware/identify.lua; its cells are as declared."""
        self.record(name, (ROOT / "scripts/hardware/identify.lua").read_text(), *words)
        status, out, err = self.identify(f"{name}.h5", "--experiment", f"{name}.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        return json.loads((self.folder / "identified.json").read_text()), out

    def share_held(self, found, what, truth):
        """How many intervals of 95 % of cells hold, of one."""
        of = found["cells"]
        held = [abs(value - truth) <= 1.96 * error for states, values, errors in zip(of["state"], of[what], of[f"{what}_error"])
                for state, value, error in zip(states, values, errors) if state == 0]
        return sum(held) / len(held)

    def test_cells_that_saw_too_few_steps_are_not_identified(self):
        for seed in (4, 2):
            found, out = self.of_own_table("short", "--set", "seconds=0.3", "--set", f"seed={seed}", "--vary", "sensor.pin_height.noise=0.01")
            self.assertRegex(out, r"\n  \d\d cells not identified: they saw too few steps")
            states = [state for row in found["cells"]["state"] for state in row]
            self.assertGreater(states.count(0), 10)
            noise = found["sensors"]["pin_height"]["values"]["noise"]
            self.assertLess(abs(noise["value"] - 0.01), 0.001)
            rows = [line.split(",") for line in (self.folder / "identified.csv").read_text().splitlines()[1:]]
            self.assertEqual({row[3] for row in rows}, {"gain", "offset"})  # none is late
            self.assertEqual(len(rows), 2 * states.count(0))
            for row in rows:
                self.assertLess(abs(float(row[4]) - (row[3] == "gain")), 0.1, row)
            for name, truth in (("max_speed", 12), ("max_acceleration", 200)):
                value, error = found["parameters"][f"actuator.{name}"].values()
                self.assertLess(abs(value - truth), 4 * error, name)

    def test_readings_of_a_coarse_encoder_are_no_drift(self):
        found, _ = self.of_own_table("coarse", "--set", "seconds=4", "--set", "seed=5", "--vary", "sensor.pin_height.noise=0.01",
                                     "--vary", "sensor.pin_height.quantize=0.08")
        of = found["sensors"]["pin_height"]
        self.assertIn("the steps of the readings hide it", of["not_identified"]["drift"])
        self.assertAlmostEqual(of["values"]["quantize"]["value"], 0.08, places=6)
        self.assertLess(abs(of["values"]["noise"]["value"] - 0.01), 0.0005)
        for name, truth in (("gain", 1), ("offset", 0)):
            self.assertGreater(self.share_held(found, name, truth), 0.85, name)

    def test_errors_grow_by_a_drift(self):
        for drift in (0.005, 0.03):
            found, _ = self.of_own_table("drift", "--set", "seconds=4", "--set", "seed=2", "--vary", "sensor.pin_height.noise=0.01",
                                         "--vary", f"sensor.pin_height.drift={drift}")
            of = found["sensors"]["pin_height"]["values"]
            for name, truth in (("noise", 0.01), ("drift", drift)):
                self.assertLess(abs(of[name]["value"] - truth), 4 * of[name]["error"], name)
            for name, truth in (("gain", 1), ("offset", 0)):
                self.assertGreater(self.share_held(found, name, truth), 0.85, name)
            for name, truth in (("max_speed", 12), ("max_acceleration", 200)):  # although all pins begin at their lower limit
                value, error = found["parameters"][f"actuator.{name}"].values()
                self.assertLess(abs(value - truth), 1.96 * error, name)
            self.assertEqual(found["not_identified"]["actuator.lag"], "too short for the readings, if any")

    def test_a_cell_without_delay_does_not_hold_the_others_in_theirs(self):
        draw = random.Random(1)
        rows, delays = ["row,column,channel,fault,value"], []
        for r, c in ((r, c) for r in range(4) for c in range(4)):
            delays.append(draw.choice((0, 0, 1, 2)))
            rows.append(f"{r},{c},height,gain,{draw.uniform(0.9, 1.1)}")
            rows += [f"{r},{c},height,late,{delays[-1]}"] if delays[-1] else []
        self.write("secret.csv", "\n".join(rows) + "\n")
        table = public().replace("seed = 3", "seed = 1").replace("at(3,", "at(5,")
        truth = {"actuator.max_speed": 6, "actuator.max_acceleration": 300}
        recording = self.record("secret", table + "faults { map = 'secret.csv' }\n", *(
            word for name, value in (*truth.items(), ("sensor.pin_height.noise", 0.05), ("sensor.pin_height.drift", 0.05)) for word in ("--vary", f"{name}={value}")))
        self.write("public.lua", table)
        status, _, err = self.identify(recording, "--experiment", "public.lua", "-o", "identified.lua")
        self.assertEqual(status, 0, err)
        found = json.loads((self.folder / "identified.json").read_text())
        # In a tick a pin moves by about as much as its noise.
        wrong = [at for at, delay in enumerate(delay for row in found["cells"]["delay"] for delay in row) if delay != delays[at]]
        self.assertLessEqual(len(wrong), 1, wrong)
        for name, value in truth.items():
            estimate, error = found["parameters"][name].values()
            self.assertLess(abs(estimate - value), 4 * error, name)

    def test_what_does_not_fit_is_refused(self):
        recording = self.record("table", public())
        self.write("other.lua", public(rows=5))
        self.refused("rows 4, but other.lua has 5: is of another table", recording, "--experiment", "other.lua", "-o", "identified.lua")
        self.write("wheels.lua", "world { control_period = 0.01, dt = 0.005 } surface { rows = 4, columns = 4, actuator = wheels {} }")
        self.refused("actuator channel 'height', which wheels.lua does not have", recording, "--experiment", "wheels.lua", "-o", "identified.lua")
        self.refused("nothing.h5: no such file", "nothing.h5", "--experiment", "table.lua", "-o", "identified.lua")
        self.refused("nowhere.lua: No such file", recording, "--experiment", "nowhere.lua", "-o", "identified.lua")
        self.refused("no such object", recording, "--experiment", "table.lua", "-o", "identified.lua", "--object", "ball")
        self.refused("no actuator channel 'depth'", recording, "--experiment", "table.lua", "-o", "identified.lua", "--channel", "depth")
        self.refused("would overwrite", recording, "--experiment", "table.lua", "-o", "table.lua")
        whole = (self.folder / recording).read_bytes()
        for part in (0, 100, len(whole) // 2, len(whole) - 1):
            (self.folder / "cut.h5").write_bytes(whole[:part])
            self.refused("cut.h5: cannot be read as a recording", "cut.h5", "--experiment", "table.lua", "-o", "identified.lua")
        self.refused("no sensor channel 'pin_heigth' (it has pin_height)", recording, "--experiment", "table.lua", "-o", "identified.lua",
                     "--sensor", "pin_heigth")
        self.write("deep.lua", public().replace("{0, 5}", "{0, 5.5}"))
        self.refused("'height' ranges from 0 to 5, but from 0 to 5.5 in deep.lua: is of another table", recording, "--experiment", "deep.lua",
                     "-o", "identified.lua")
        conveyors = public().replace("pin { range = {0, 5}, max_speed = 10, max_acceleration = 150 }", "conveyor { lift = {0, 5} }")
        lifted = self.record("conveyors", conveyors.replace("'height'", "'lift'"))
        for words in ((), ("--channel", "lift")):
            self.refused("only pins are identified", lifted, "--experiment", "conveyors.lua", "-o", "identified.lua", *words)
        self.refused("the commands of 'height' never change", self.record("still", public(moves="false")), "--experiment", "table.lua",
                     "-o", "identified.lua")
        self.refused("record with record { actuators = true }", self.record("mute", public(actuators="false")), "--experiment", "table.lua",
                     "-o", "identified.lua")

    def test_a_hostile_recording_is_refused(self):
        import h5py
        import numpy as np
        whole = (self.folder / self.record("table", public())).read_bytes()
        os.mkfifo(self.folder / "pipe")  # whoever opens it waits

        def elsewhere(file, path):
            shape = file[path].shape
            del file[path]
            file.create_dataset(path, shape, "f4", external=[("pipe", 0, h5py.h5f.UNLIMITED)])

        def replace(file, path, value):
            del file[path]
            file[path] = value
        with h5py.File(self.folder / "dense.h5", "w", libver="latest") as file:
            for i in range(8001):
                file.require_group("many").attrs[f"a{i}"] = i
        dense = h5py.File(self.folder / "dense.h5")
        self.addCleanup(dense.close)
        for says, change in (
                ("/meta/many has 8001 attributes; at most 8000 are read", lambda file: file.copy(dense["many"], "meta/many")),
                ("/tick is not in the file itself", lambda file: replace(file, "tick", h5py.ExternalLink("pipe", "/tick"))),
                ("/tick is not in the file itself", lambda file: replace(file, "tick", h5py.SoftLink("/time"))),
                ("/sensors/pin_height is not in the file itself", lambda file: elsewhere(file, "sensors/pin_height")),
                ("its ticks are no whole numbers", lambda file: replace(file, "tick", np.full(300, np.nan))),
                ("its ticks do not ascend", lambda file: replace(file, "tick", np.uint64(2**63 - 150) + np.arange(300, dtype="u8"))),
                ("its ticks are no whole numbers", lambda file: replace(file, "tick", np.zeros(300, [("a", "u8"), ("b", "f4")]))),
                ("needs too much memory", lambda file: (file.move("tick", "was"), file.create_dataset("tick", (2**40,), "u8", chunks=(1024,)))),
                ("of 4 x 4 numbers", lambda file: replace(file, "actuators/height", np.zeros((5, 4, 4), "f4"))),
                ("of 4 x 4 numbers", lambda file: replace(file, "sensors/pin_height", np.zeros((301, 4, 4), "c8"))),
                ("no command of 'height' is a finite number", lambda file: file["actuators/height"].write_direct(
                    np.full(file["actuators/height"].shape, np.nan, "f4"))),
                ("cannot be read as a recording", lambda file: replace(file, "sensors", np.zeros(4))),
                ("cannot be read as a recording", lambda file: file["meta"].attrs.create("every", "\x1b[2J\nx")),
                (r"actuator channel '\x1b[2J'", lambda file: file.copy("actuators/height", "actuators/\x1b[2J"))):
            (self.folder / "hostile.h5").write_bytes(whole)
            with h5py.File(self.folder / "hostile.h5", "r+") as file:
                change(file)
            with self.subTest(says=says):
                self.refused(says, "hostile.h5", "--experiment", "table.lua", "-o", "identified.lua")

    def test_a_crash_of_hdf5_is_no_crash_of_the_reader(self):
        sys.path.insert(0, str(BIN.parent / "python"))
        from smartsurf import _recorded
        from smartsurf._recorded import RecordingError, read_apart
        recording = self.folder / self.record("table", public())
        self.assertEqual(read_apart(recording, lambda name, file: file["surface"].attrs["rows"]), 4)
        with self.assertRaisesRegex(RecordingError, "table.h5: is damaged"):
            read_apart(recording, lambda name, file: os.kill(os.getpid(), signal.SIGSEGV))
        with unittest.mock.patch.object(_recorded, "MOST_S", 0.2), self.assertRaisesRegex(RecordingError, "table.h5: needs more than 0 s of processor"):
            read_apart(recording, lambda name, file: [None for _ in iter(int, 1)])
        os.mkfifo(self.folder / "fifo.h5")
        with self.assertRaisesRegex(RecordingError, "fifo.h5: is not a regular file"):
            read_apart(self.folder / "fifo.h5", lambda name, file: None)
        with self.assertRaisesRegex(RecordingError, "table.h5: .*too much memory"):
            read_apart(recording, lambda name, file: bytes(1 << 33))


@unittest.skipUnless(HAS_ALL, "needs h5py, SciPy and the Python package")
class Interpreters(ProgramTest):
    def starts(self, **environment):
        """Whether `identify` is started by the python3 that is first on PATH."""
        folder = self.folder / "first"
        folder.mkdir(exist_ok=True)
        other = folder / "python3"
        other.write_text("#!/bin/sh\necho another interpreter\n")
        other.chmod(0o755)
        without = {name: value for name, value in os.environ.items() if name not in ("SMARTSURF_PYTHON", "VIRTUAL_ENV", "CONDA_PREFIX")}
        told = subprocess.run([SMARTSURF, "identify", "--help"], capture_output=True, text=True,
                              env={**without, "PATH": f"{folder}:{os.environ['PATH']}", **environment})
        self.assertEqual((told.returncode, told.stderr), (0, ""))
        return told.stdout == "another interpreter\n"

    def test_a_build_folder_takes_the_interpreter_of_its_package_unless_an_environment_is_active(self):
        self.assertFalse(self.starts())
        self.assertTrue(self.starts(VIRTUAL_ENV=str(self.folder)))
        self.assertTrue(self.starts(CONDA_PREFIX=str(self.folder)))
        self.assertTrue(self.starts(SMARTSURF_PYTHON=str(self.folder / "first/python3")))


if __name__ == "__main__":
    unittest.main()
