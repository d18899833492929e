"""Pictures, depth, segmentation, films for notebooks, and the window."""
import base64
import importlib.util
import io
import os
import re
import struct
import subprocess
import sys
import unittest
import zlib
from unittest import mock

try:
    import gymnasium  # noqa: F401
    import numpy as np
    import smartsurf
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import HAS_XVFB, Display, ExperimentTest

SCENE = """
surface { rows = 8, columns = 10, actuator = pin { range = {0, 2} } }
sphere { radius = 1, position = {4, 3, 2.5}, label = 'ball', colour = '#ff0000' }
box { size = {1.5, 1.5, 1.5}, position = {7, 5, 1.75}, label = 'box', colour = '#0000ff' }
"""
HAS_VIEW = os.environ.get("SMARTSURF_VIEW") == "ON"


def decoded(data):
    """The frames of a PNG, each height × width × 3."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise AssertionError("no PNG")
    at, frames, size, numbers = 8, [], None, []
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if zlib.crc32(kind + body) != struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0]:
            raise AssertionError("wrong checksum")
        if kind == b"IHDR":
            size = struct.unpack(">II", body[:8])
        elif kind == b"acTL":
            count = struct.unpack(">I", body[:4])[0]
        elif kind == b"fcTL":
            numbers.append(struct.unpack(">I", body[:4])[0])
        elif kind in (b"IDAT", b"fdAT"):
            if kind == b"fdAT":
                numbers.append(struct.unpack(">I", body[:4])[0])
            lines = np.frombuffer(zlib.decompress(body[4 * (kind == b"fdAT"):]), np.uint8).reshape(size[1], 1 + 3 * size[0])
            frames.append(lines[:, 1:].reshape(size[1], size[0], 3))
        at += 12 + length
    if len(frames) > 1 and (count != len(frames) or numbers != list(range(len(numbers)))):
        raise AssertionError(f"{count} frames announced, numbers {numbers}")
    return frames


class Pictures(ExperimentTest):
    def test_depth_and_segmentation_from_above_are_exact(self):
        s = smartsurf.Simulation(self.script(SCENE))
        eye = 30.0
        camera = ((4.0, 3.0, eye), (4.0, 3.0, 0.0))
        depth, what = s.render_depth(161, 121, camera), s.render_segmentation(161, 121, camera)
        self.assertEqual((depth.dtype, depth.shape, what.shape), (np.float32, (121, 161), (121, 161)))
        self.assertEqual(what[60, 80], 0)
        self.assertAlmostEqual(float(depth[60, 80]), eye - 3.5, places=3)  # the top of the ball
        cells = what <= -2
        np.testing.assert_allclose(depth[cells & (depth > eye - 0.5)], eye, atol=0.01)  # tops at height 0; it looks down almost
        self.assertTrue(np.isinf(depth[what == -1]).all() and np.isfinite(depth[what != -1]).all())
        places = []  # of the cells that are wholly visible, in the grid and in the picture
        for cell in range(80):
            row, column = divmod(cell, 10)
            v, u = np.nonzero(what == -2 - cell)
            if v.size and not np.isin(what[v.min() - 1:v.max() + 2, u.min() - 1:u.max() + 2], (0, 1)).any() \
                    and 0 < v.min() and v.max() < 120 and 0 < u.min() and u.max() < 160:
                places.append((1, column, row, u.mean(), v.mean()))
        places = np.array(places)
        fitted, *_ = np.linalg.lstsq(places[:, :3], places[:, 3:], rcond=None)
        self.assertLess(np.abs(places[:, :3] @ fitted - places[:, 3:]).max(), 0.6)
        self.assertGreater(len(places), 25)
        self.assertGreater(min(fitted[1, 0], fitted[2, 1]), 5)  # columns to the right, rows downwards

    def test_an_object_that_is_followed_stays_in_the_middle(self):
        s = smartsurf.Simulation(self.script(SCENE))
        for view in ("iso", "top", ((4, -20, 15), (4, 3, 0))):
            for position in ((1, 1, 2), (9, 6, 4), (-3, 12, 6)):
                s.teleport("ball", position=position)
                for follow in ("ball", 0):
                    what = s.render_segmentation(121, 91, smartsurf.Camera(view, follow))
                    v, u = (index.mean() for index in np.nonzero(what == 0))
                    self.assertLess(abs(v - 45) + abs(u - 60), 2.5, (view, position))

    def test_mistakes_are_named(self):
        s = smartsurf.Simulation(self.script(SCENE))
        for camera, message in (("front", "camera = 'front': must be 'iso', 'top', 'side'"),
                                (((0, 0), (0, 0)), "two points"), (((0, 0, 9), (0, 0)), "two points"), (((0, 0, 0), (0, 0, 9)), "a position above a target"),
                                (smartsurf.Camera(follow="cup"), "no object is called 'cup'"),
                                (smartsurf.Camera(follow=7), "must be 0 to 1")):
            with self.assertRaisesRegex(ValueError, message) as raised:
                s.render_depth(32, 32, camera)
            self.assertNotIn("\n", str(raised.exception))
        with self.assertRaisesRegex(ValueError, "1 to 8192"):
            s.render_depth(9000, 10)

    def test_films_are_animated_pngs(self):
        random = np.random.default_rng(1)
        frames = [random.integers(0, 256, (13, 17, 3), dtype=np.uint8) for _ in range(4)]
        video = smartsurf.Video(frames[:3], period=0.05)
        video.add(frames[3])
        video.save(self.folder / "film.png")
        for one, other in zip(decoded((self.folder / "film.png").read_bytes()), frames, strict=True):
            np.testing.assert_array_equal(one, other)
        with mock.patch.dict(sys.modules, {"PIL": None}):
            self.assertRegex(video._repr_html_(), '^<img width="17" src="data:image/png;base64,[A-Za-z0-9+/=]+"/>$')
        if importlib.util.find_spec("PIL"):
            shown = re.fullmatch('<img width="17" src="data:image/webp;base64,([A-Za-z0-9+/=]+)"/>', video._repr_html_())
            from PIL import Image
            film = Image.open(io.BytesIO(base64.b64decode(shown[1])))
            self.assertEqual((film.n_frames, film.size), (4, (17, 13)))
        with self.assertRaisesRegex(ValueError, "frame 1 has shape"):
            smartsurf.Video([frames[0], frames[1][:5]])._repr_html_()
        for wrong, shown in ((frames[0][0], r"shape \(17, 3\) and type uint8"), (frames[0][:, :, :2], r"shape \(13, 17, 2\)"),
                             (frames[0] / 255, "type float64"), (frames[0].astype(int), "type int64"), (frames[0][:0], r"shape \(0, 17, 3\)")):
            for call in (lambda: smartsurf.Video([wrong]), lambda: video.add(wrong)):
                with self.assertRaisesRegex(ValueError, f"^frame has .*{shown}.*: must be height × width × 3, uint8$"):
                    call()
        self.assertEqual(len(video.frames), 4)
        for period in (0, -1, np.nan, np.inf, 66, "1", None):
            with self.assertRaisesRegex(ValueError, f"^period = {period!r}: must be above 0 and at most 65.535, in seconds$"):
                smartsurf.Video(frames, period)
        for name in ("film.gif", "film"):
            with self.assertRaisesRegex(ValueError, r"^path = '.*film.*': must end in \.png"):
                video.save(self.folder / name)
            self.assertFalse((self.folder / name).exists())

    @unittest.skipUnless(HAS_VIEW, "built without the view")
    def test_the_picture_shows_what_the_segmentation_says(self):
        s = smartsurf.Simulation(self.script(SCENE))
        for camera in ("iso", "side", smartsurf.Camera("iso", "box"), ((12, -14, 9), (5, 4, 1))):
            picture = s.render(240, 180, camera).astype(int)
            what = s.render_segmentation(240, 180, camera)
            red = picture[..., 0] > picture[..., 1:].max(axis=-1) + 40
            blue = picture[..., 2] > picture[..., :2].max(axis=-1) + 40
            for colour, id in ((red, 0), (blue, 1)):
                overlap = (colour & (what == id)).sum() / (colour | (what == id)).sum()
                self.assertGreater(overlap, 0.8, (camera, id))
        self.assertIn("experiment.lua: tick 0", s._repr_html_())
        self.assertRegex(s._repr_html_(), "^<img ")
        envs = smartsurf.VectorEnv(self.script(SCENE), 2, render_mode="rgb_array", render_size=(64, 48),
                                   camera=smartsurf.Camera("top", "ball"))
        envs.reset(seed=1)
        self.assertEqual([p.shape for p in envs.render()], [(48, 64, 3)] * 2)

    @unittest.skipUnless(HAS_VIEW and HAS_XVFB, "no view or no virtual display")
    def test_the_window(self):
        display = Display("800x600")
        self.addCleanup(display.close)
        program = (f"import smartsurf\nenv = smartsurf.Env({self.script(SCENE)!r}, render_mode='human', render_size=(320, 240))\n"
                   "env.reset(seed=1)\nfor _ in range(5): env.step(env.action_space.sample())\n"
                   "print(env.simulation.tick, env._window._core is not None)\nenv.close()")
        environment = {**os.environ, "DISPLAY": display.name}
        shown = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=120)
        self.assertEqual((shown.stdout.split(), shown.returncode), (["5", "True"], 0), shown.stderr)
        self.assertNotIn("tkinter", shown.stderr)
        environment["DISPLAY"] = ":none"
        refused = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=120)
        self.assertNotEqual(refused.returncode, 0)
        self.assertRegex(refused.stderr.strip().splitlines()[-1], "RuntimeError: .*display")


if __name__ == "__main__":
    unittest.main()
