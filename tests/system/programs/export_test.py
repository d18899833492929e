"""The exported page: its data, and in headless Chromium, driven over its debugging pipe."""
import base64
import re
import zlib

import h5py
import numpy as np
from browser import CHROMIUM, Browser
from programs import *


def positions(page):
    """The objects' positions by frame and the frames' times, read as player.js does."""
    text = page.read_text()
    scene = json.loads(re.search(r'id="scene">(.*?)</script>', text, re.S)[1])
    layout, frames = scene["series"][0], len(scene["time"])
    assert layout["name"] == "position"
    count, width = layout["values"], layout["bytes"]
    planes = np.frombuffer(zlib.decompress(base64.b64decode(re.search(r'id="frames">(.*?)</script>', text, re.S)[1])),
                           np.uint8, frames * width * count).reshape(frames, width, count).astype(np.uint64)
    none = 2 ** (8 * width) - 1
    codes = sum(planes[:, byte] << np.uint64(8 * byte) for byte in range(width)).cumsum(0) & np.uint64(none)
    values = layout["low"] + codes * ((layout["high"] - layout["low"]) / (none - 1))
    return np.where(codes == none, np.nan, values).reshape(frames, -1, 3), np.array(scene["time"])


class Export(ProgramTest):
    def export(self):
        recording, page = str(self.folder / "wave.h5"), str(self.folder / "wave.html")
        experiment = self.write("wave.lua", (ROOT / "scripts/examples/wave.lua").read_text() +
                                "\nrecord { sensors = true }\n")
        status, _, err = self.run_program(SMARTSURF, "run", experiment, "--no-controller", "--until", "6",
                                          "--record", recording)
        self.assertEqual(status, 0, err)
        status, _, err = self.run_program(SMARTSURF, "export", recording, "-o", page)
        self.assertEqual(status, 0, err)
        return page

    def test_writes_page_or_reports_one_line(self):
        page = pathlib.Path(self.export())
        self.assertGreater(page.stat().st_size, 500_000)
        self.assertIn('"name":"sensors/proximity","unit":"u"', page.read_text())
        status, _, err = self.run_program(SMARTSURF, "export", str(self.folder / "wave.h5"), "-o", "wave.htm")
        self.assertEqual(status, 2)
        self.assertIn(".html", err)
        self.assertEqual(err.count("\n"), 1)

    def test_positions_in_any_unit_and_far_below_the_table(self):
        for u in (0.01, 1, 1000):
            self.write("unit.lua", f"""
                world {{ gravity = {-400 * u}, ground = false }}
                surface {{ rows = 24, columns = 24, pitch = {u},
                          actuator = pin {{ top = {{{.8 * u}, {.8 * u}}}, range = {{0, {4 * u}}}, length = {2 * u} }} }}
                sphere {{ radius = {1.5 * u}, position = {{{3 * u}, {3 * u}, {6 * u}}} }}
                sphere {{ radius = {1.5 * u}, position = {{{20 * u}, {20 * u}, {6 * u}}} }}
                sphere {{ radius = {1.5 * u}, position = {{{60 * u}, {20 * u}, {6 * u}}} }}
                """)
            for command in (["run", "unit.lua", "--no-controller", "--until", "12", "--record", "unit.h5"],
                            ["export", "unit.h5", "-o", "unit.html"]):
                status, _, err = self.run_program(SMARTSURF, *command)
                self.assertEqual(status, 0, err)
            shown, times = positions(self.folder / "unit.html")
            with h5py.File(self.folder / "unit.h5") as file:
                recorded = file["objects/position"][:][np.searchsorted(file["time"][:], times - 1e-9)]
            self.assertLess(recorded[-1, 2, 2], -20_000 * u, "it falls beside the table")
            self.assertLess(np.abs(shown - recorded).max(), 24 * u / 16_000)

    @unittest.skipUnless(CHROMIUM, "chromium is not installed")
    def test_page_plays_and_responds_to_clicks(self):
        browser = Browser(self.folder, self.export())
        try:
            self.wait_for(lambda: browser.value("!!window.player && player.ready"), "the player is ready")
            self.wait_for(lambda: browser.value("player.frame") > 2, "it plays by itself")
            browser.click("#play")
            self.assertEqual(browser.value("[player.playing, document.getElementById('play').textContent]"),
                             [False, "Play"])
            frame = browser.value("player.frame")
            browser.click("#forward")
            self.assertEqual(browser.value("player.frame"), frame + 1)
            browser.value("(s => { s.value = 30; s.dispatchEvent(new Event('input')); })"
                          "(document.getElementById('slider'))")
            self.wait_for(lambda: browser.value("player.shown") == 30, "the slider leads to its frame")
            self.assertIn("1.00 of 6.00 s", browser.value("document.getElementById('clock').textContent"))
            plain = browser.screenshot()
            browser.value("(s => { s.value = 'sensors/proximity'; s.dispatchEvent(new Event('change')); })"
                          "(document.getElementById('cells'))")
            browser.click("#names")
            self.wait_for(lambda: browser.value("player.shown") == 30, "the heat map is drawn")
            self.assertFalse(browser.value("document.getElementById('legend').hidden"))
            heat = browser.screenshot()
            self.assertNotEqual(plain, heat)
            browser.drag((500, 300), (700, 320))
            time.sleep(0.3)
            self.assertNotEqual(browser.screenshot(), heat, "the view does not turn")
            self.assertGreater(len(plain), 30_000, "the picture is empty")
            if folder := os.environ.get("SMARTSURF_KEEP"):
                for name, bytes_ in (("plain", plain), ("heat", heat), ("turned", browser.screenshot())):
                    pathlib.Path(folder, f"{name}.png").write_bytes(bytes_)
            browser.click("#view-top")
            self.assertEqual(browser.value("player.view"), "top")
            time.sleep(0.3)
            middle = browser.value("[innerWidth / 2 - 60, innerHeight / 2 - 60]")
            for kind in ("mousePressed", "mouseReleased"):
                browser.call("Input.dispatchMouseEvent", type=kind, x=middle[0], y=middle[1], button="left", clickCount=1)
            self.wait_for(lambda: browser.value("document.querySelector('#inspect h2').textContent"), "the selection is shown")
            self.assertRegex(browser.value("document.querySelector('#inspect h2').textContent"), r"^(Cell, row \d+|Object \d+)")
            self.wait_for(lambda: browser.value("document.querySelectorAll('#inspect dd').length") >= 1, "values are shown")
            self.assertFalse(browser.value("document.getElementById('inspect').hidden"))
            self.assertTrue(browser.value("player.marker.visible"))
            self.assertIn("sensors: proximity, u", browser.value("[...document.querySelectorAll('#cells option')].map(o => o.text)"))
            shapes = "[...new Set(player.marker.children.map(m => m.geometry.type))]"
            browser.value("(player.selected = { object: 0 }) && (player.shown = -1)")
            self.wait_for(lambda: browser.value(shapes) == ["SphereGeometry"], "the outline has the shape of the object")
            light = browser.screenshot()
            browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
            self.wait_for(lambda: browser.value("player.dark"), "the colours follow the system")
            if folder := os.environ.get("SMARTSURF_KEEP"):
                time.sleep(0.3)
                for name, bytes_ in (("light", light), ("dark", browser.screenshot())):
                    pathlib.Path(folder, f"{name}.png").write_bytes(bytes_)
            self.assertEqual(browser.errors, [])
        finally:
            browser.close()

    def rectangle(self, browser, selector):
        return browser.value(f"(r => [r.x, r.y, r.width, r.height])(document.querySelector('{selector}').getBoundingClientRect())")

    @unittest.skipUnless(CHROMIUM, "chromium is not installed")
    def test_plots_beside_the_scene_lead_through_time(self):
        browser = Browser(self.folder, self.export())
        try:
            self.wait_for(lambda: browser.value("!!window.player && player.ready"), "the player is ready")
            titles = "[...document.querySelectorAll('#plots figcaption span')].map(s => s.textContent)"
            self.assertEqual(browser.value(titles), ["contact points", "mean speed, u/s"])
            x, y, width, height = self.rectangle(browser, "#plots canvas")
            scene = self.rectangle(browser, "#scene-area")
            self.assertGreaterEqual(x, scene[0] + scene[2], "the plots hide the scene")
            browser.drag((x + 0.2 * width, y + height / 2), (x + 0.5 * width, y + height / 2))
            self.wait_for(lambda: browser.value("document.getElementById('clock').textContent").startswith("3.0"), "3 of 6 s")
            browser.value("player.selected = null")
            for kind in ("mousePressed", "mouseReleased"):
                browser.call("Input.dispatchMouseEvent", type=kind, x=scene[2] / 2, y=scene[3] / 2, button="left", clickCount=1)
            self.wait_for(lambda: browser.value("document.querySelectorAll('#quantity option').length") >= 1, "quantities")
            browser.click("#add-plot")
            self.assertEqual(len(browser.value(titles)), 3)
            self.assertRegex(browser.value(titles)[2], r"^(Cell, row \d+|Object \d+).*, ")
            browser.click("#plots figure:nth-child(1) button")
            self.assertEqual(len(browser.value(titles)), 2)
            self.assertEqual(browser.errors, [])
        finally:
            browser.close()

    @unittest.skipUnless(CHROMIUM, "chromium is not installed")
    def test_telephones_give_the_height_to_the_scene(self):
        browser = Browser(self.folder, self.export())
        try:
            self.wait_for(lambda: browser.value("!!window.player && player.ready"), "the player is ready")
            for width, height, share in ((844, 390, 0.88), (390, 844, 0.9)):
                browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=2, mobile=True)
                browser.value("document.getElementById('show-plots').checked && document.getElementById('show-plots').click()")
                self.wait_for(lambda: self.rectangle(browser, "#view")[2:] == self.rectangle(browser, "#scene-area")[2:],
                              "the picture fills its area")
                self.wait_for(lambda: self.rectangle(browser, "#scene-area")[3] >= share * height, "the scene uses the height")
                self.assertEqual(browser.value("document.documentElement.scrollWidth"), width)
                self.assertFalse(self.rectangle(browser, "#more")[2], "the menu is closed")
                browser.click("#menu")
                x, y, menu_width, menu_height = self.rectangle(browser, "#more")
                self.assertTrue(x >= 0 and y >= 0 and x + menu_width <= width and y + menu_height <= height)
                browser.click("#view-side")
                self.assertEqual(browser.value("player.view"), "side")
                browser.click("#menu")
                browser.value("document.getElementById('show-plots').click()")
                plots, scene = self.rectangle(browser, "#plots"), self.rectangle(browser, "#scene-area")
                beside = plots[0] >= scene[0] + scene[2] - 1
                self.assertEqual(beside, width > height, "beside the scene, or upright below it")
            self.assertEqual(browser.errors, [])
        finally:
            browser.close()


if __name__ == "__main__":
    unittest.main()
