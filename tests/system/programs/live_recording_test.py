"""smartsurf record: a recording of a surface that another process drives."""
import signal
import sys
import time

import h5py
import numpy

from programs import *

BRIDGE, EMULATOR, FAKE = BIN / "surface_bridge", BIN / "device_emulator", BIN / "fake_surface"
PROGRAM = ROOT / "scripts/hardware/raise.aps"


class LiveRecordings(ProgramTest):
    def record(self, *flags, file="live.h5"):
        return self.start(SMARTSURF, "record", "--shm", self.shm, "-o", str(self.folder / file), *flags)

    def read(self, file="live.h5"):
        return h5py.File(self.folder / file, locking=False)

    def frames(self, file="live.h5"):
        try:
            with self.read(file) as f:
                return len(f["tick"])
        except (OSError, KeyError):  # it is being written
            return 0

    def fake(self, *flags):
        return self.start(str(FAKE), "--shm", self.shm, "--size", "12x8", "--mode", "passive", "--period-ms", "20", *flags)

    def controller(self):
        return self.start(APRON, "run", str(PROGRAM), "--shm", self.shm)

    def controller_that_waits(self):
        return self.start(APRON, "run", str(PROGRAM), "--shm", self.shm, "--wait", "60")

    def test_equals_what_the_surface_and_its_controller_exchanged(self):
        recorder, controller = self.record("--wait", "60"), self.controller_that_waits()
        for child in recorder, controller:
            self.wait_for_handler(child, signal.SIGTERM)
        surface = self.fake("--ticks", "200")
        status, out, err = self.finish(recorder)
        self.assertEqual((status, err), (0, ""))
        self.finish(surface), self.finish(controller)
        with self.read() as f:
            tick, lost = f["tick"][:], f["lost"][:]
            self.assertGreater(len(tick), 50)
            self.assertEqual(len(tick), int(out.split()[1]))
            self.assertEqual(lost.sum(), int(out.split()[3].rstrip(":")))
            numpy.testing.assert_array_equal(numpy.diff(tick.astype(int)), lost[1:].astype(int) + 1)
            self.assertTrue((numpy.diff(f["clock/host_ns"][:].astype(float)) > 0).all())
            # The commands are those of the program at the tick that they answer.
            height, answered = f["actuators/height"][:], f["answers/tick"][:]
            row, column = numpy.mgrid[0:8, 0:12].astype("f4")
            for n in numpy.flatnonzero(answered == tick)[:40]:
                phase = (column + row * 0.5 + float(tick[n]) * 0.25) * 0.2
                numpy.testing.assert_allclose(height[n], 1 + numpy.sin(phase), atol=1e-4)
            latency = f["answers/latency_us"][:]
            self.assertTrue((latency[numpy.isfinite(latency)] >= 0).all())
            self.assertGreater(numpy.isfinite(latency).sum(), 0)
            self.assertEqual(f["sensors/proximity_hit"].attrs["maximum"], 1)
            meta = f["meta"].attrs
            self.assertEqual((meta["outcome"], meta["ticks"]), ("the surface closed", tick[-1]))
            self.assertAlmostEqual(meta["control_period_s"], 0.02)
            for name in ("engine", "seed", "dt_s", "iterations", "gravity", "ground", "sleep", "state_hash", "success"):
                self.assertNotIn(name, meta)
            frames = len(tick)
        info = self.run_program(SMARTSURF, "info", str(self.folder / "live.h5"))[1]
        self.assertNotRegex(info, "(?m)^seed|^state hash|engine|dt ")
        self.assertIn("control period 0.02 s, passive mode", info)
        missing = int(tick[-1]) - int(tick[0]) + 1 - frames
        self.assertRegex(info, rf"(?m)^frames .* every tick{f', {missing} missing' if missing else ''}$")
        self.check_commands("live.h5")

    def test_frames_that_were_not_seen_are_counted(self):
        sys.path.insert(0, str(ROOT / "shm-protocol/python"))
        import shm_protocol
        with shm_protocol.Surface(self.shm, 2, 2, 0.02, sensors=[shm_protocol.Channel("d")],
                                  actuators=[shm_protocol.Channel("height", 0, 4, 3)], mode="passive") as surface:
            recorder = self.record("--frames", "5")
            for tick in range(0, 20000, 2):  # as if each other frame were lost
                surface.publish(tick, tick * 0.02)
                time.sleep(0.02)
                if recorder.poll() is not None:
                    break
        self.assertEqual(self.finish(recorder)[0], 0)
        with self.read() as f:
            tick = f["tick"][:].astype(int)
            self.assertEqual(f["meta"].attrs["ticks"], tick[-1])
        info = self.run_program(SMARTSURF, "info", str(self.folder / "live.h5"))[1]
        self.assertRegex(info, rf"(?m)^frames +5, .* every tick, {tick[-1] - tick[0] + 1 - 5} missing$")

    def check_commands(self, file):
        path = str(self.folder / file)
        status, out, err = self.run_program(SMARTSURF, "info", path)
        self.assertEqual((status, err), (0, ""))
        self.assertIn("8 rows × 12 columns", out)
        for command in (["plot", path, "-o", str(self.folder / "p.svg"), "--what", "height:2,3"],
                        ["plot", path, "-o", str(self.folder / "q.svg"), "--what", "proximity_hit:1,1"],
                        ["export", path, "-o", str(self.folder / "p.html")]):
            status, _, err = self.run_program(SMARTSURF, *command)
            self.assertEqual((status, err), (0, ""), command)
        for what in ("contacts", "objects", "speed", "trajectories"):  # of which a live surface says nothing
            status, _, err = self.run_program(SMARTSURF, "plot", path, "-o", str(self.folder / "r.svg"), "--what", what)
            self.assertEqual((status, len(err.splitlines())), (2, 1), err)
            self.assertIn("live surface", err)
        status, _, err = self.run_program(SMARTSURF, "replay", path, "--verify")
        self.assertEqual((status, len(err.splitlines())), (2, 1), err)
        self.assertIn("cannot be run again: it is of a live surface", err)

    def test_simulator_is_recorded_as_by_itself(self):
        own = self.folder / "own.h5"
        script = self.folder / "s.lua"
        script.write_text("record { sensors = true, actuators = true }\n" + (ROOT / "scripts/hardware/pillars.lua").read_text())
        surface = self.start(SMARTSURF, "run", str(script), "--shm", self.shm, "--headless", "--until", "2", "--pace", "1", "--record", str(own))
        recorder = self.record()
        self.wait_for((self.folder / "live.h5.part").exists, "the recording")
        controller = self.start(APRON, "run", str(ROOT / "scripts/hardware/pillars.aps"), "--shm", self.shm)
        self.assertEqual(self.finish(recorder)[0], 0)
        self.finish(surface), self.finish(controller)
        with self.read() as live, h5py.File(own, locking=False) as simulated:
            shared, a, b = numpy.intersect1d(live["tick"][:], simulated["tick"][:], return_indices=True)
            self.assertGreater(len(shared), 30)
            for name in simulated["sensors"]:
                numpy.testing.assert_array_equal(live["sensors"][name][:][a], simulated["sensors"][name][:][b], name)

    def test_cells_have_their_places_and_bases(self):
        sys.path.insert(0, str(ROOT / "shm-protocol/python"))
        import shm_protocol
        positions = numpy.array([[[0, 1, 0.5], [1.5, 1, 0]], [[0, 0, 2], [1.5, 0, -1]]], dtype="f4")
        height = shm_protocol.Channel("height", 0, 4, 3)
        for name, places in (("raised", positions), ("level", positions * numpy.array([1, 1, 0], "f4"))):
            with shm_protocol.Surface(self.shm, 2, 2, 0.02, sensors=[shm_protocol.Channel("d")], actuators=[height],
                                      positions=places, mode="passive") as surface:
                recorder = self.record("--frames", "2", file=name + ".h5")
                for tick in range(10000):
                    surface.publish(tick, tick * 0.02)
                    time.sleep(0.02)
                    if recorder.poll() is not None:
                        break
            self.assertEqual(self.finish(recorder)[0], 0)
            with self.read(name + ".h5") as f:
                numpy.testing.assert_array_equal(f["surface/place"][..., :2], places[..., :2])
                self.assertEqual("base" in f["surface"], name == "raised")
                if name == "raised":
                    numpy.testing.assert_array_equal(f["surface/base"][:], places[..., 2])
            exported = self.run_program(SMARTSURF, "export", name + ".h5", "-o", name + ".html")
            self.assertEqual(exported[0], 0, exported[2])

    def test_base_of_a_simulated_grid_is_that_of_the_cells(self):
        sys.path.insert(0, str(ROOT / "shm-protocol/python"))
        import shm_protocol
        script = self.folder / "raised.lua"
        script.write_text("world { dt = 0.005, control_period = 0.02 }\n"
                          "surface { rows = 2, columns = 3, pitch = 1.5, base = function(row, column) return 10 * row + column end }\n")
        base = 10.0 * numpy.array([[1, 1, 1], [2, 2, 2]]) + numpy.array([1, 2, 3])
        self.start(SMARTSURF, "run", str(script), "--shm", self.shm, "--mode", "passive", "--headless", "--until", "60")
        recorder = self.record("--frames", "5", "--wait", "60")
        with shm_protocol.Observer(self.shm, timeout=60) as observer:
            places = observer.description.positions
            numpy.testing.assert_array_equal(places[..., 2], base)
            numpy.testing.assert_array_equal(places[..., 0], [[0, 1.5, 3]] * 2)
            numpy.testing.assert_array_equal(places[..., 1], [[1.5] * 3, [0] * 3])
        self.assertEqual(self.finish(recorder)[0], 0)
        with self.read() as f:
            numpy.testing.assert_array_equal(f["surface/base"][:], base)
            self.assertNotIn("place", f["surface"])

    def test_latency_is_that_of_the_answers(self):
        sys.path.insert(0, str(ROOT / "shm-protocol/python"))
        import shm_protocol
        truth, height = {}, shm_protocol.Channel("height", 0, 4, 3)
        noise = numpy.random.default_rng(1).random((200, 200), dtype="f4")  # takes longer to write than an answer
        with shm_protocol.Surface(self.shm, 200, 200, 0.02, sensors=[shm_protocol.Channel("d")], actuators=[height],
                                  mode="passive") as surface, shm_protocol.Controller(self.shm) as controller:
            recorder = self.record("--frames", "100")
            for tick in range(20000):
                surface.sensors["d"][:] = noise
                sent = [time.monotonic()]
                surface.publish(tick, tick * 0.02)
                sent.append(time.monotonic())
                if tick % 10 == 9:  # two frames wait for the recorder
                    time.sleep(0.01)
                    recorder.send_signal(signal.SIGCONT)
                    time.sleep(0.005)
                controller.wait()
                time.sleep(0.003)
                controller.actuators["height"][:] = 1
                answered = [time.monotonic()]
                controller.publish()
                answered.append(time.monotonic())
                truth[tick] = answered[0] - sent[1], answered[1] - sent[0]
                surface.latest()
                time.sleep(0.015)
                if recorder.poll() is not None:
                    break
                if tick % 10 == 7:
                    recorder.send_signal(signal.SIGSTOP)
                    self.wait_for(lambda: fields(recorder.pid)[0] in "TZ", "the recorder to stand still")
        self.assertEqual(self.finish(recorder)[0], 0)
        with self.read() as f:
            latency = f["answers/latency_us"][:] * 1e-6
            known = numpy.isfinite(latency)
            least, most = numpy.array([truth[tick] for tick in f["tick"][:]])[known].T
        self.assertGreater(known.sum(), 0)
        two_looks = 0.002001  # holds however busy the computer is: the recorder knows when it looked late
        self.assertGreater((latency[known] - least).min(), -two_looks)
        self.assertLess((latency[known] - most).max(), two_looks)

    def test_killed_recorder_leaves_a_readable_file(self):
        self.fake()
        self.controller()
        recorder = self.record()
        self.wait_for(lambda: self.frames() > 60, "60 frames")
        recorder.kill()
        recorder.wait()
        with self.read() as f:
            self.assertGreater(len(f["tick"]), 60)
            self.assertNotIn("outcome", f["meta"].attrs)
        self.check_commands("live.h5")

    def test_vanishing_surface_is_one_line_and_status_3(self):
        surface = self.fake()
        self.controller()
        recorder = self.record()
        self.wait_for((self.folder / "live.h5.part").exists, "the recording")
        surface.kill()
        status, out, err = self.finish(recorder)
        self.assertEqual((status, len(err.splitlines())), (3, 1), err)
        with self.read() as f:
            self.assertEqual(len(f["tick"]), int(out.split()[1]))
        status, _, err = self.finish(self.record("--wait", "0.1", file="none.h5"))
        self.assertEqual((status, len(err.splitlines())), (3, 1), err)
        self.assertFalse((self.folder / "none.h5").exists())

    def test_end_by_signal_and_by_number_of_frames(self):
        self.fake()
        self.controller()
        status, out, _ = self.finish(self.record("--frames", "20"))
        self.assertEqual((status, out.split()[1]), (0, "20"))
        recorder = self.record(file="b.h5")
        self.wait_for((self.folder / "b.h5.part").exists, "the recording")
        recorder.send_signal(signal.SIGINT)
        self.assertEqual(self.finish(recorder)[0], 130)
        with self.read("b.h5") as f:
            self.assertEqual(f["meta"].attrs["outcome"], "stopped by the user")

    def test_bridge_records_its_table(self):
        self.shm = f"tb-{os.getpid()}"  # leaves room for .boards
        table = self.folder / "t.toml"
        self.start(str(EMULATOR), "--tcp", "0", "--boards", "2x1", "--size", "4x4", "--period-ms", "20", "--table", str(table),
                   "--slew", "3", "--most-moving", "5")
        self.wait_for(table.exists, "the table")
        bridge = self.start(str(BRIDGE), "--table", str(table), "--shm", self.shm, "--ticks", "600", "--record", str(self.folder / "live.h5"))
        self.controller_that_waits()
        status, out, err = self.finish(bridge)
        self.assertEqual(status, 0, err)
        with self.read() as f:
            self.assertEqual(f["boards/valid"].shape, (len(f["tick"]), 2))
            self.assertEqual(len(f["tick"]) + f["lost"][:].sum(), 600)
            self.assertLessEqual(len(f["tick"]) + f["lost"][1:].sum(), f["tick"][-1] - f["tick"][0] + 1)
            valid = f["sensors/valid"][:]
            known = f["boards/valid"][:, 0] <= 1
            self.assertGreater(known.sum(), 60)
            numpy.testing.assert_array_equal(valid[known, 0, 0], f["boards/valid"][:, 0][known])
            # Limits, and the command in force: what the board echoes a tick later.
            self.assertTrue((f["boards/slew.height"][:][known] == 3).all() and (f["boards/most_moving.height"][:][known] == 5).all())
            self.assertTrue((f["boards/acceleration.height"][:][known] == 0).all())
            self.assertTrue((f["boards/limited"][:, 0][known][-1] > 0) and (f["boards/flags"][:, 0][known] & 8).any())
            in_force = f["boards/in_force"][:, 0]
            follows = known & (in_force < 2**32 - 1)
            self.assertGreater(follows.sum(), 40)
            self.assertTrue((in_force[follows] < f["tick"][:][follows]).all())
            self.assertTrue((f["boards/tick"][:, 1][known][1:] >= f["boards/tick"][:, 1][known][:-1]).all())

    def bridge(self, *flags):
        device = self.start(str(EMULATOR), "--tcp", "0", "--size", "4x4", "--period-ms", "5", "--once")
        return self.start(str(BRIDGE), device.stdout.readline().split()[1], "--shm", self.shm, "--mode", "passive", *flags,
                          "--record", str(self.folder / "live.h5"))

    def test_bridge_waits_for_its_recorder(self):
        status, _, err = self.finish(self.bridge("--ticks", "300"))
        self.assertEqual(status, 0, err)
        with self.read() as f:
            self.assertEqual(len(f["tick"]) + f["lost"][:].sum(), 300)
            self.assertEqual(f["tick"][0], f["lost"][0])
            self.assertNotIn("late", err)

    def test_bridge_says_that_its_recorder_ended(self):
        bridge = self.bridge("--ticks", "2000")
        self.wait_for((self.folder / "live.h5.part").exists, "the recording")
        for recorder in children(bridge.pid):
            os.kill(recorder, signal.SIGKILL)
        status, _, err = self.finish(bridge)
        self.assertEqual(status, 1)
        self.assertEqual(err.count("smartsurf record ended"), 1, err)
        self.assertIn("surface_bridge: smartsurf record ended by signal 9: the recording is not whole; the session goes on\n", err)


if __name__ == "__main__":
    unittest.main()
