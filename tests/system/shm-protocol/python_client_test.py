"""The Python client: every role, the arrays' memory and flags and lifetimes, errors.

usage: python_client_test.py [unittest's arguments]; needs SHM_PROTOCOL_LIBRARY and shm_protocol on PYTHONPATH;
SOURCE_ROOT names the source tree.
"""
import gc
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time
import unittest

from python_pair import ACTUATORS, ROOT, SENSORS, pair, unique

import numpy as np
import shm_protocol
from shm_protocol import Channel, Controller, Error, NotFound, Observer, Result, Surface, SurfaceDied
from shm_protocol import _library


def mapped_ranges(name):
    """Address ranges at which this process has mapped the segment, and whether it may write there."""
    for line in pathlib.Path("/proc/self/maps").read_text().splitlines():
        if line.endswith(f"/dev/shm/smartsurf.{name}"):
            low, high, flags = re.match(r"(\w+)-(\w+) (\S+)", line).groups()
            yield int(low, 16), int(high, 16), "w" in flags


def lies_in_segment(array, name):
    address = array.__array_interface__["data"][0]
    return any(low <= address < high for low, high, _ in mapped_ranges(name))


class Roles(unittest.TestCase):
    def test_discovers_channels_sizes_and_positions(self):
        positions = np.arange(5 * 7 * 3, dtype=np.float32).reshape(5, 7, 3)
        surface, controller = pair("describe", pitch=2.5, positions=positions)
        with surface, controller:
            d = controller.description
            self.assertEqual((d.rows, d.columns, d.pitch, d.period, d.mode), (5, 7, 2.5, 0.01, "time-step"))
            self.assertEqual(d.surface_pid, os.getpid())
            self.assertEqual([(c.name, c.direction) for c in d.channels],
                             [("distance", "sensor"), ("state", "sensor"), ("force", "sensor"),
                              ("height", "actuator"), ("lamp", "actuator")])
            self.assertEqual((d.channels[0].unit, d.channels[0].maximum, d.channels[0].safe), ("u", 8.0, 8.0))
            np.testing.assert_array_equal(d.positions, positions)

    def test_lock_step_with_every_value_checked(self):
        surface, controller = pair("lockstep")
        with surface, controller:
            for tick in range(200):
                surface.sensors["distance"][:] = np.arange(35).reshape(5, 7) % 8 + tick % 2
                surface.sensors["state"][:] = tick % 4
                surface.sensors["force"][:] = np.arange(3)[:, None, None] + tick % 3
                surface.publish(tick, tick * 0.01)
                self.assertTrue(controller.wait(10))
                self.assertEqual((controller.tick, controller.frame.frame), (tick, tick + 1))
                np.testing.assert_array_equal(controller.sensors["distance"],
                                              np.arange(35).reshape(5, 7) % 8 + tick % 2)
                self.assertTrue((controller.sensors["state"] == tick % 4).all())
                self.assertEqual(controller.sensors["force"].shape, (3, 5, 7))
                self.assertTrue((controller.sensors["force"][2] == 2 + tick % 3).all())
                controller.actuators["height"][:] = tick % 5
                controller.actuators["lamp"][:] = tick
                self.assertTrue(controller.publish())
                self.assertTrue(surface.wait(10))
                self.assertTrue((surface.actuators["height"] == tick % 5).all())
                self.assertTrue((surface.actuators["lamp"] == tick).all())
                self.assertEqual(surface.frame.answers, tick + 1)

    def test_turns_are_kept(self):
        surface, controller = pair("turns")
        with surface, controller:
            with self.assertRaises(Error) as nothing:
                controller.publish()
            self.assertEqual(nothing.exception.result, Result.OUT_OF_TURN)
            with self.assertRaises(ValueError):
                controller.sensors["distance"]
            with self.assertRaisesRegex(KeyError, "there is no channel 'distnace' here, only distance"):
                controller.sensors["distnace"]
            surface.publish(0, 0.0)
            with self.assertRaises(Error):
                surface.publish(1, 0.0)
            with self.assertRaises(TimeoutError):
                surface.wait(0.01)
            self.assertTrue(controller.wait(1))
            with self.assertRaises(Error):
                controller.wait(1)

    def test_values_are_clamped_and_counted_for_both(self):
        surface, controller = pair("clamp")
        with surface, controller:
            surface.publish(0, 0.0)
            controller.wait(1)
            controller.actuators["height"][:] = 2
            controller.actuators["height"][0, :3] = np.nan, np.inf, -1
            controller.actuators["lamp"][:] = 1001
            controller.publish()
            self.assertTrue(surface.wait(1))
            self.assertEqual(list(surface.actuators["height"][0, :4]), [1, 4, 0, 2])
            self.assertEqual(surface.counters["surface"].clamped, 3 + 35)
            self.assertEqual(controller.counters["surface"].clamped, 3 + 35)

    def test_passive_reads_the_newest_and_counts(self):
        surface, controller = pair("passive", mode="passive")
        with surface, controller:
            self.assertFalse(controller.latest())
            for tick in range(5):
                surface.sensors["distance"][:] = tick
                surface.publish(tick, 0.0)
            self.assertTrue(controller.latest())
            self.assertEqual(controller.tick, 4)
            self.assertTrue((controller.sensors["distance"] == 4).all())
            self.assertFalse(controller.latest())
            self.assertFalse(surface.latest())
            self.assertGreater(controller.counters["controller"].repeated, 0)
            self.assertFalse(lies_in_segment(controller.sensors["distance"], surface.description.name))

    def test_observer_sees_both_directions_and_maps_read_only(self):
        surface, controller = pair("observe")
        name = surface.description.name
        with surface, controller:
            before = {low for low, _, _ in mapped_ranges(name)}
            with Observer(name) as observer:
                mine = [writable for low, _, writable in mapped_ranges(name) if low not in before]
                self.assertEqual(mine, [False])
                self.assertEqual([name for name in ("write", "next_cells") if hasattr(observer, name)], [])
                self.assertFalse(observer.latest())
                surface.sensors["distance"][:] = 3
                surface.publish(7, 0.07)
                self.assertTrue(observer.wait(timeout=5))
                self.assertTrue((observer.sensors["distance"] == 3).all())
                self.assertEqual(observer.frame().tick, 7)
                controller.wait(1)
                controller.actuators["height"][:] = np.nan
                controller.publish()
                self.assertTrue(observer.latest("actuator"))
                self.assertTrue(np.isnan(observer.actuators["height"]).all())  # as written
                self.assertEqual(observer.frame("actuator").answers, 1)
                self.assertEqual(observer.controller_pid, os.getpid())
                self.assertEqual((observer.surface_state, observer.controller_state), ("running", "running"))
                with self.assertRaises(ValueError):
                    observer.sensors["distance"][0, 0] = 1
                surface.close()
                self.assertFalse(observer.wait(timeout=5))
                self.assertEqual(observer.surface_state, "closing")


class Chunks(unittest.TestCase):
    def test_large_frames_are_read_and_answered_chunk_by_chunk(self):
        surface = Surface(unique("chunks"), 200, 300, 0.01, SENSORS[:1], ACTUATORS[:1])
        controller = Controller(surface.description.name)
        values = np.arange(60_000, dtype=np.float32) % 7
        with surface, controller:
            surface.write("distance", values[:30_000])
            first = controller.next_cells("distance", timeout=0)
            np.testing.assert_array_equal(first, values[:len(first)])
            self.assertTrue(0 < len(first) <= 30_000)
            self.assertTrue(lies_in_segment(first, surface.description.name))
            self.assertFalse(first.flags.writeable)
            controller.write("height", first / 7)
            while controller.next_cells("distance", timeout=0) is not None:
                pass  # what is there; the rest does not come in time
            surface.write("distance", values[30_000:], first=30_000)
            surface.publish(0, 0.0)
            rest = 0
            while (cells := controller.next_cells("distance")) is not None:
                rest += len(cells)
            self.assertGreaterEqual(rest, 29_000)
            self.assertTrue(controller.wait(timeout=5))
            controller.write("height", values[len(first):] / 7, first=len(first))
            controller.publish()
            taken = []
            while (cells := surface.next_cells("height")) is not None:
                taken.append(cells.copy())
            self.assertTrue(surface.wait(timeout=5))
            np.testing.assert_array_equal(np.concatenate(taken), values / 7)
            np.testing.assert_array_equal(surface.actuators["height"].ravel(), values / 7)
            with self.assertRaisesRegex(KeyError, "no actuator channel 'distance'"):
                controller.write("distance", values)


class Memory(unittest.TestCase):
    def test_arrays_are_the_shared_memory_itself(self):
        surface, controller = pair("zero-copy")
        name = surface.description.name
        with surface, controller:
            out = surface.sensors["distance"]
            self.assertTrue(lies_in_segment(out, name))
            self.assertEqual(out.__array_interface__["data"][0] % 64, 0)
            out[:] = 5
            surface.publish(0, 0.0)
            controller.wait(1)
            self.assertTrue(lies_in_segment(controller.sensors["distance"], name))
            self.assertTrue(lies_in_segment(controller.actuators["height"], name))
            self.assertTrue((controller.sensors["distance"] == 5).all())

    def test_what_is_not_ones_own_is_read_only(self):
        surface, controller = pair("flags")
        with surface, controller:
            surface.publish(0, 0.0)
            controller.wait(1)
            for array in (controller.sensors["distance"], surface.actuators["height"]):
                with self.assertRaises(ValueError):
                    array[0, 0] = 1
                with self.assertRaises(ValueError):
                    array.flags.writeable = True

    def test_a_published_array_cannot_be_written_any_more(self):
        surface, controller = pair("published")
        with surface, controller:
            for tick in range(9):  # round the ring twice
                sensed = surface.sensors["distance"]
                sensed[:] = tick % 8
                surface.publish(tick, 0.0)
                with self.assertRaises(ValueError):
                    sensed[:] = 9
                controller.wait(1)
                self.assertTrue((controller.sensors["distance"] == tick % 8).all())
                moved = controller.actuators["height"]
                moved[:] = 1
                controller.publish()
                with self.assertRaises(ValueError):
                    moved[:] = 2
                self.assertTrue(surface.wait(1))
                self.assertTrue((surface.actuators["height"] == 1).all())

    def test_arrays_of_a_closed_endpoint_cannot_be_written(self):
        surface, first = pair("closed")
        name = surface.description.name
        surface.publish(0, 0.0)
        first.wait(1)
        kept = first.actuators["height"]
        kept[:] = 1
        first.close()
        with surface, Controller(name, timeout=1) as second:
            second.wait(1)
            second.actuators["height"] = 2
            second.actuators["lamp"] = 3
            for late in (kept, first.actuators["height"], first.actuators["lamp"]):
                with self.assertRaises(ValueError):
                    late[:] = 4
            with self.assertRaises(ValueError):
                first.actuators["height"] = 4
            self.assertTrue(second.publish())
            self.assertTrue(surface.wait(1))
            self.assertTrue((surface.actuators["height"] == 2).all())
            self.assertTrue((surface.actuators["lamp"] == 3).all())
            sensed = surface.sensors["distance"]
        for late in (sensed, surface.sensors["distance"]):
            with self.assertRaises(ValueError):
                late[:] = 5

    def test_arrays_outlive_their_endpoints(self):
        surface, controller = pair("lifetime")
        name = surface.description.name
        surface.sensors["distance"][:] = 6
        surface.publish(0, 0.0)
        controller.wait(1)
        kept = controller.sensors["distance"]
        controller.close()
        surface.close()
        self.assertFalse(os.path.exists(f"/dev/shm/smartsurf.{name}"))
        del surface, controller
        gc.collect()
        self.assertTrue((kept == 6).all())
        self.assertEqual(self.deleted(name), 1)
        del kept
        gc.collect()
        self.assertEqual(self.deleted(name), 0)  # and then the memory is given back

    @staticmethod
    def deleted(name):
        return sum(1 for _ in mapped_ranges(name + " (deleted)"))

    def test_structures_have_the_sizes_of_the_header(self):
        header = (ROOT / "shm-protocol/include/shm_protocol/shm_protocol.h").read_text()
        import ctypes
        for python, c in (("ChannelInfo", "ssp_channel_info"), ("FrameInfo", "ssp_frame_info"),
                          ("Counters", "ssp_counters"), ("SegmentInfo", "ssp_segment_info")):
            size = int(re.search(rf"sizeof\({c}\) == (\d+)", header).group(1))
            self.assertEqual(ctypes.sizeof(getattr(_library, python)), size)
        for name, number in re.findall(r"^  SSP_(\w+) = (-?\d+),?", header, re.M):
            if name.startswith("E_"):
                name = {"E_INTERRUPTED": "ATTACH_INTERRUPTED"}.get(name, name[2:])
            if name in ("LIVING", "ORPHAN"):
                continue
            if name == "FOREIGN" and int(number) > 0:
                continue
            self.assertEqual(Result[name], int(number))


class Ends(unittest.TestCase):
    def test_no_such_surface(self):
        start = time.monotonic()
        with self.assertRaises(NotFound) as e:
            Controller(unique("none"), timeout=0.2)
        self.assertGreaterEqual(time.monotonic() - start, 0.2)
        self.assertIn("there is no surface", str(e.exception))

    def test_names_and_pids_in_errors(self):
        surface, controller = pair("taken")
        with surface, controller:
            with self.assertRaises(Error) as second:
                Controller(surface.description.name)
            self.assertEqual((second.exception.result, second.exception.pid), (Result.CONTROLLER_LIVES, os.getpid()))
            with self.assertRaises(Error) as again:
                Surface(surface.description.name, 1, 1, 1.0, SENSORS)
            self.assertEqual((again.exception.result, again.exception.pid), (Result.SURFACE_LIVES, os.getpid()))
        with self.assertRaises(Error) as bad:
            Surface(unique("bad"), 0, 1, 1.0, SENSORS)
        self.assertIn("rows = 0", str(bad.exception))

    def test_impossible_values_are_not_taken_modulo(self):
        good = {"name": unique("modulo"), "rows": 1, "columns": 1, "period": 1.0, "sensors": SENSORS}
        for field, values in {"rows": (2**32 + 2, -1), "columns": (2**32 + 2, -1), "slots": (2**32 + 4, -4),
                              "period": (-1, 1e20, float("nan"), float("inf")),
                              "name": (good["name"] + "\0x",)}.items():
            for value in values:
                with self.assertRaises(Error, msg=f"{field} = {value}") as bad:
                    Surface(**{**good, field: value})
                self.assertEqual(bad.exception.result, Result.BAD_CONFIG)
                self.assertRegex(str(bad.exception), rf"^{field} .*: must ")
        for channel, where in ((Channel("a", components=2**32 + 1), "components"), (Channel("a", components=-1), "components"),
                               (Channel("a\0b"), "channel"), (Channel("a", unit="m\0m"), "unit")):
            with self.assertRaises(Error, msg=where) as bad:
                Surface(**{**good, "sensors": [channel]})
            self.assertIn(where, str(bad.exception))
        with Surface(**good) as surface:
            for arguments in ((-1, 0.0), (2**64, 0.0), (0, 0.0, -1), (0, 0.0, 2**32)):
                with self.assertRaises(Error, msg=arguments) as bad:
                    surface.publish(*arguments)
                self.assertEqual(bad.exception.result, Result.ARGUMENT)
            for ask in (Controller, shm_protocol.Observer, shm_protocol.clean):
                with self.assertRaises(Error, msg=ask) as bad:
                    ask(good["name"] + "\0x")
                self.assertIn("NUL", str(bad.exception))

    def test_leaving_is_told_to_the_other(self):
        surface, controller = pair("leave")
        self.assertTrue(surface.wait_for_controller(10))
        surface.publish(0, 0.0)
        controller.close()
        self.assertFalse(surface.wait(10))
        self.assertEqual(surface.result, Result.CONTROLLER_CLOSED)
        with Controller(surface.description.name) as other:
            surface.close()
            # The frame that nobody answered comes first, then the end.
            while other.wait(10):
                other.publish()

    def test_a_killed_surface_is_noticed_and_its_segment_cleaned(self):
        name = unique("killed")
        child = subprocess.Popen([sys.executable, "-c", f"""
import shm_protocol, time
s = shm_protocol.Surface({name!r}, 5, 7, 0.01, [shm_protocol.Channel("distance")])
s.publish(0, 0.0)
time.sleep(100)"""])
        try:
            with Controller(name, timeout=20) as controller, Observer(name) as observer:
                self.assertTrue(controller.wait(10))
                self.assertEqual(controller.surface_status, Result.OK)
                controller.publish()
                self.assertTrue(observer.latest())
                child.kill()
                child.wait()
                with self.assertRaises(SurfaceDied):
                    controller.wait(20)
                with self.assertRaises(SurfaceDied):
                    observer.wait(timeout=20)
                self.assertEqual((observer.surface_state, controller.surface_status), ("dead", Result.SURFACE_DEAD))
            found = {s.name: s.ownership for s in shm_protocol.list_surfaces()}
            self.assertEqual(found[name], "orphan")
        finally:
            child.kill()
            removed = shm_protocol.clean(name)
        self.assertEqual([s.name for s in removed], [name])

    def test_the_example_says_in_one_line_that_its_surface_was_killed(self):
        name = unique("said")
        child = subprocess.Popen([sys.executable, "-c", f"""
import shm_protocol
from shm_protocol import Channel
s = shm_protocol.Surface({name!r}, 5, 7, 0.01, [Channel("proximity_hit")], [Channel("height", maximum=6)])
s.wait_for_controller()
s.publish(0, 0.0)
while s.wait():
    s.publish(s.frame.tick + 1, 0.0)"""])
        controller = subprocess.Popen([sys.executable, ROOT / "shm-protocol/examples/controller.py", name],
                                      stderr=subprocess.PIPE, text=True)
        try:
            with Observer(name, timeout=20) as observer:
                while observer.frame().frame < 3:
                    observer.wait(timeout=20)
            child.kill()
            child.wait()
            _, said = controller.communicate(timeout=20)
            self.assertEqual((controller.returncode, said), (3, f"the surface {name} died\n"))
        finally:
            child.kill()
            controller.kill()
            shm_protocol.clean(name)

    def test_reconnects_to_a_surface_of_the_same_layout_only(self):
        surface, controller = pair("again")
        with controller:
            session = controller.description.session
            surface.close()
            surface = Surface(controller.description.name, 5, 7, 0.01, SENSORS, ACTUATORS)
            controller.reconnect(5)
            self.assertNotEqual(controller.description.session, session)
            surface.close()
            surface = Surface(controller.description.name, 5, 8, 0.01, SENSORS, ACTUATORS)
            for _ in range(2):
                with self.assertRaises(Error) as e:
                    controller.reconnect(5)
                self.assertEqual(e.exception.result, Result.LAYOUT_CHANGED)
            surface.close()
            surface = Surface(controller.description.name, 5, 7, 0.01, SENSORS, ACTUATORS)
            controller.reconnect(5)
            self.assertEqual(controller.description.columns, 7)
            surface.close()

    def test_ctrl_c_ends_a_wait(self):
        surface, controller = pair("interrupt")
        with surface, controller:
            with self.assertRaises(KeyboardInterrupt):
                threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
                controller.wait(60)


if __name__ == "__main__":
    unittest.main()
