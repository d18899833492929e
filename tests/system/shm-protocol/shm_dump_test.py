#!/usr/bin/env python3
"""shm_dump as a user runs it: header, channels, arrays, rates, JSON, list, clean, exit statuses.

usage: shm_dump_test.py SHM_DUMP SURFACE CONTROLLER FROZEN_PAIR
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
from processes import handles  # noqa: E402

SHM_DUMP, SURFACE, CONTROLLER, FROZEN_PAIR = sys.argv[1:5]


def dump(*arguments, status=0):
    done = subprocess.run([SHM_DUMP, *arguments], capture_output=True, text=True, timeout=30)
    assert done.returncode == status, f"{arguments}: status {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout if status in (0,) else done.stderr


class Pair:
    """The example's surface, waiting for its controller."""

    def __init__(self, name):
        self.name = f"dump-{name}-{os.getpid()}"
        self.surface = subprocess.Popen([SURFACE, self.name])
        dump(self.name, "--wait", "10")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.surface.kill()
        self.surface.wait()
        dump(f"--clean={self.name}")


class Frozen:
    """A pair that stands still after so many ticks."""

    def __init__(self, rows, columns, ticks):
        self.name = f"dump-frozen-{os.getpid()}"
        self.process = subprocess.Popen([FROZEN_PAIR, self.name, str(rows), str(columns), str(ticks)],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "frozen\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.communicate()


class Dump(unittest.TestCase):
    def test_header_channels_and_states(self):
        with Pair("header") as pair:
            text = dump(pair.name)
            self.assertTrue(text.startswith(f"{pair.name}\n8 x 8 cells, pitch 1, time-step, period 16.6667 ms (60 Hz)"))
            self.assertRegex(text, rf"surface +pid {pair.surface.pid} +ready +no frame yet")
            self.assertRegex(text, r"controller +none attached")
            self.assertRegex(text, r"proximity_hit +sensor +f32 +8 x 8 +0 … 1 +-")
            self.assertRegex(text, r"height +actuator +f32 +8 x 8 +0 … 6 u +-")
            self.assertLessEqual(max(map(len, text.splitlines())), 80)

    def test_json_agrees_with_the_run(self):
        with Pair("json") as pair:
            follower = subprocess.Popen([SHM_DUMP, pair.name, "--json", "--numbers", "--follow=0.001"],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            first = json.loads(follower.stdout.readline())
            self.assertEqual(first["surface"]["pid"], pair.surface.pid)
            self.assertEqual([c["name"] for c in first["channels"]], ["proximity_hit", "height"])
            self.assertEqual(subprocess.run([CONTROLLER, pair.name], stderr=subprocess.DEVNULL).returncode, 0)
            looks, errors = follower.communicate(timeout=30)
            self.assertEqual(follower.returncode, 0, errors)
            self.assertIn("closing", errors)
            looks = [json.loads(line) for line in looks.splitlines()]
            last = looks[-1]
            self.assertEqual(last["surface"]["frame"]["frame"], 500)
            for look in looks:
                for channel in look["channels"]:
                    if "values" not in channel:
                        continue
                    sensor = channel["direction"] == "sensor"
                    tick = look["surface" if sensor else "controller"]["frame"]["tick"]
                    spot = [float(i == tick % 64) for i in range(64)]
                    self.assertEqual(channel["values"], spot if sensor else [4 - 4 * v for v in spot])
            self.assertTrue(any("values" in c for c in last["channels"]))

    def test_arrays_as_numbers_and_as_a_map(self):
        with Frozen(8, 8, 11) as pair:
            numbers = dump(pair.name, "-n", "-c", "spot").split("spot, tick 10")[1]
            table = [line.split() for line in numbers.splitlines() if line.strip()]
            self.assertEqual(table, [["1" if (y, x) == (1, 2) else "0" for x in range(8)] for y in range(8)])
            picture = dump(pair.name, "--map", "-c", "spot", "--colour=never").splitlines()[-4:]
            self.assertEqual([len(line) for line in picture], [8] * 4)
            marked = [(y, x) for y, line in enumerate(picture) for x, c in enumerate(line) if c != " "]
            self.assertEqual(marked, [(0, 2)])
            coloured = dump(pair.name, "--map", "-c", "spot", "--colour=always").splitlines()[-4:]
            self.assertEqual([line.count("\u2580") for line in coloured], [8] * 4)
            self.assertEqual([line.count("48;2;252;231;33m") for line in coloured], [1, 0, 0, 0])  # the lower half

    def test_numbers_that_are_none_and_counters(self):
        with Frozen(8, 8, 11) as pair:
            text = dump(pair.name)
            # The controller's frame as it wrote it, and what the surface made of it.
            self.assertRegex(text, r"height +actuator +f32 +2 x 8 x 8 +-1 … 1 m +-0.5 … 0.5, 1 NaN/∞")
            self.assertRegex(text, r"surface +0 +0 +11 +0 ")
            self.assertRegex(text, rf"controller +pid {pair.process.pid} +running +frame 11 +tick 10 +0.100 s")
            look = json.loads(dump(pair.name, "-j", "-n"))
            height = [c for c in look["channels"] if c["name"] == "height"][0]
            self.assertEqual(height["shape"], [2, 8, 8])
            self.assertEqual(height["values"].count(None), 1)
            self.assertEqual(look["surface"]["counters"]["clamped"], 11)

    def test_large_arrays_fit_the_width(self):
        with Frozen(150, 300, 2) as pair:
            for form in ("--numbers", "--map"):
                text = dump(pair.name, form, "--colour=never")
                self.assertLessEqual(max(map(len, text.splitlines())), 80)
            self.assertEqual(len(dump(pair.name, "-n", "-a", "-c", "spot").splitlines()[-1].split()), 300)

    def test_list_clean_and_a_dead_surface(self):
        with Pair("orphan") as pair:
            self.assertRegex(dump("--list"), rf"{pair.name} +living +{pair.surface.pid}")
            self.assertIn("nothing to remove", dump(f"--clean={pair.name}"))
            pair.surface.kill()
            pair.surface.wait()
            self.assertRegex(dump("--list"), rf"{pair.name} +orphan +{pair.surface.pid}")
            entry = [s for s in json.loads(dump("--list", "--json")) if s["name"] == pair.name]
            self.assertEqual(entry[0]["ownership"], "orphan")
            self.assertIn("is dead", dump(pair.name, status=3))
            self.assertIn(f"removed {pair.name}", dump(f"--clean={pair.name}"))
            self.assertFalse(os.path.exists(f"/dev/shm/smartsurf.{pair.name}"))

    def test_statuses(self):
        self.assertIn("Exit status", dump("--help"))
        self.assertIn("there is no surface", dump("no-such-surface", status=3))
        self.assertIn("--nonsense", dump("--nonsense", status=2))
        self.assertIn("--list", dump(status=2))
        self.assertIn("must be a number", dump("x", "--follow=often", status=2))
        self.assertIn("must be a number", dump("x", "--follow=nan", status=2))
        self.assertIn("name", dump("not/a/name", status=2))
        with Pair("status") as pair:
            self.assertIn("proximity_hit, height", dump(pair.name, "--channel", "depth", status=2))
            follower = subprocess.Popen([SHM_DUMP, pair.name, "--follow=0.01"], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
            follower.stdout.readline()
            pair.surface.kill()
            self.assertIn("died", follower.communicate(timeout=30)[1])
            self.assertEqual(follower.returncode, 3)

    def test_signals(self):
        with Pair("signal") as pair:
            for number in (signal.SIGINT, signal.SIGTERM):
                for arguments in ((f"{pair.name}-none", "--wait", "50"), (pair.name, "--follow=0.01")):
                    process = subprocess.Popen([SHM_DUMP, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                    if "--wait" not in arguments:
                        process.stdout.readline()
                    while not handles(process.pid, number) and process.poll() is None:
                        time.sleep(0.01)
                    process.send_signal(number)
                    self.assertEqual(process.communicate(timeout=30)[1], "")
                    self.assertEqual(process.returncode, 128 + number, arguments)

    def test_a_foreign_file_is_named_and_left_alone(self):
        path = f"/dev/shm/smartsurf.dump-foreign-{os.getpid()}"
        with open(path, "wb") as file:
            file.write(b"not ours" * 1000)
        try:
            name = path.split("smartsurf.")[1]
            self.assertRegex(dump("--list"), rf"{name} +foreign")
            self.assertIn("not a surface's segment", dump(name, status=2))
            dump(f"--clean={name}")
            self.assertTrue(os.path.exists(path))
        finally:
            os.unlink(path)

    @unittest.skipUnless(os.geteuid() == 0, "only root sees the segments of all users")
    def test_list_and_name_agree_about_another_users_segment(self):
        with Pair("other-user") as pair:
            self.assertNotRegex(dump("--list"), rf"{pair.name} .*user")
            os.chown(f"/dev/shm/smartsurf.{pair.name}", 65534, 65534)
            self.assertRegex(dump("--list"), rf"{pair.name} +living .* of another user \(65534\)\n")
            self.assertEqual([s["user"] for s in json.loads(dump("--list", "--json")) if s["name"] == pair.name], [65534])
            self.assertIn("belongs to another user (65534), who alone may map it", dump(pair.name, status=2))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]])
