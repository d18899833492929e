"""The exported page draws mechanisms where the simulator's view does: its script's poses are those of `export -o FILE.glb`."""
import re
import shutil

import numpy as np

from gltf_test import Model
from programs import *

NODE = shutil.which("node")

# Loads the page's modules and its recording.
LOAD = """
import fs from 'node:fs';
const html = fs.readFileSync('run.html', 'utf8');
const part = (id) => html.match(new RegExp(`<script[^>]* id="${id}">([^]*?)</script>`))[1];
for (const name of ['three', 'mechanisms', 'table'])
  fs.writeFileSync(name + '.mjs', part('module-' + name).replace(/from '(three|mechanisms)'/g, "from './$1.mjs'"));
const load = (name) => import(process.cwd() + '/' + name + '.mjs');
const unpacking = part('module-player').split('const state')[0].replace(/^import.*$/gm, '') + 'return { scene, series };';
const AsyncFunction = (async () => {}).constructor;
const { scene, series } = await new AsyncFunction('document', unpacking)({ getElementById: (id) => ({ textContent: part(id) }) });
"""
# Writes the poses of each mesh's instances and the tops of the pins, of every frame, and the step of the heights, as JSON.
POSES = LOAD + """
const { cellPlaces, makeMechanisms } = await load('mechanisms');
const drawn = [], places = cellPlaces(scene), world = { add: (mesh) => drawn.push(mesh) };
const mechanisms = makeMechanisms(scene, series, world, (cell) => places[cell]);
const frames = scene.time.map((_, frame) => {
  mechanisms.set(frame);
  return {
    parts: drawn.map((mesh) => [...mesh.instanceMatrix.array]),
    tops: places.map((_, cell) => series.height.value(frame, cell) - mechanisms.recess[cell]),
  };
});
fs.writeFileSync('drawn.json', JSON.stringify({ frames, step: series.height.scale }));
"""
# Writes the heights and the colours, sRGB, of the cells in the last frame. Elements of the page and its renderer are things
# that have and take everything.
COLOURS = LOAD + """
const anything = new Proxy(function () {}, {
  get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : name === Symbol.iterator ? [][name] : name === 'value' ? '' : anything),
  set: () => true, apply: () => anything, construct: () => anything,
});
globalThis.document = globalThis.window = globalThis.Option = anything;
const { Color, Scene, SRGBColorSpace } = await load('three'), { makeTable } = await load('table'), meshes = [];
const { add } = Scene.prototype, frame = scene.time.length - 1, colour = new Color();
Scene.prototype.add = function (...parts) { meshes.push(...parts); return add.apply(this, parts); };
const table = makeTable(scene, series, anything, { view: 'iso', selected: null });
table.show(frame);
table.draw(frame);
const pins = meshes.find((mesh) => mesh.instanceColor);
const cells = Array.from({ length: scene.rows * scene.columns }, (_, cell) => {
  pins.getColorAt(cell, colour);
  const { r, g, b } = colour.getRGB({}, SRGBColorSpace);
  return [series.height.value(frame, cell), r, g, b];
});
fs.writeFileSync('drawn.json', JSON.stringify(cells));
"""

# One row of turned cells for each kind, three for the last.
KINDS = """
local top, height = {1.2, 1}, random(0, 1)
local kinds = {
  ball { top = top, radius = random(.2, .8) },
  wheels { top = top, radius = random(.1, .4), angle = random(-6, 6) },
  rotor { top = top, axis = {random(-1, 1), random(-1, 1), 1}, half_axes = {random(.2, .7), random(.2, .7), random(.2, .7)} },
  rotor { top = top, axis = {1, random(-1, 1), random(-1, 1)}, points = {{.4, 0, 0}, {-.3, .4, 0}, {-.3, -.4, 0}, {0, 0, .6}, {0, .1, -.3}} },
  force_field { top = top },
  conveyor { top = top },
  magnet { top = top },
  air_jet { top = top, lean = random(.1, 1), reach = random(1, 6) },
  pin { top = top, tip = { shape = 'hemisphere' } },
  pin { top = top, tip = { shape = 'cone', half_angle = random(.5, 1) } },
  pin { top = top, tip = { shape = 'rounded_square' } },
  delta { top = top },
  tile { top = top, command = 'pose', heave = {0, 1}, max_tilt = random(.1, .6), thickness = random(.1, 1) },
  tile { top = top, command = 'wave', max_amplitude = 3, frequency = 2 },
}
local rows, columns, places = #kinds + 2, 5, {}
for row = 1, rows do for column = 1, columns do table.insert(places, {2 * column, 2 * (rows - row), TURNED * random(-3, 3)}) end end
surface { rows = rows, columns = columns, pitch = 2, positions = places, actuators = kinds,
          cells = function(row) return math.min(row, #kinds) end }
"""
PINS = "surface { rows = 6, columns = 7, actuator = pin { range = {0, 3}, max_speed = 9 }, border = { height = 4 } }"
SKIN = """
surface { rows = 5, columns = 6, pitch = 2, skin = { kind = 'kinematic', nodes = {32, 32} },
          actuator = tile { command = 'pose', top = {1, 1}, heave = {0, 2}, max_tilt = .3 } }
"""
# Sines of random amplitudes and phases on all channels.
MOTION = """
local waves = {}
for name, most in pairs { CHANNELS } do
  waves[name] = {}
  for cell = 1, cells.rows * cells.columns do waves[name][cell] = {random(0, most), random(0, 6), random(1, 5)} end
end
on_tick(function(t)
  for name, all in pairs(waves) do
    local values = {}
    for cell, wave in ipairs(all) do values[cell] = wave[1] * math.sin(wave[2] + wave[3] * t) end
    cells:targets(name, values)
  end
end)
"""
POSE = "heave = 1, roll = .6, pitch = .6"
CHANNELS = POSE + """, height = 2, spin_x = 9, spin_y = 9, spin_a = 9, spin_b = 9, drive_x = 5, drive_y = 5, rate = 9,
    fx = 12, fy = 12, fz = 12, current = 1.5, flow = 120, direction = 6, x = .5, y = .5, phase = 6, amplitude = 4"""


def without_shear(axes):
    """Frames × axes × 3, their lengths kept: z as it is, x across it, y across both, as nodes of glTF need it."""
    upright = {}
    for k in (2, 0, 1):
        length = np.linalg.norm(axes[:, k], axis=1, keepdims=True)
        axis = axes[:, k] - sum((axes[:, k] * one).sum(1, keepdims=True) * one for one in upright.values())
        upright[k] = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
        axes = axes.copy()
        axes[:, k] = upright[k] * length
    return axes


class PageMechanisms(ProgramTest):
    def play(self, script):
        self.write("play.mjs", script)
        status, _, err = self.run_program(NODE, "play.mjs")
        self.assertEqual(status, 0, err)
        return json.loads((self.folder / "drawn.json").read_text())

    def drawn_by_page(self):
        """(axes and centre of each mesh's instances by frame, tops of the cells by frame, step of the heights)."""
        drawn = self.play(POSES)
        frames = drawn["frames"]
        return ([np.array([frame["parts"][mesh] for frame in frames]).reshape(len(frames), -1, 4, 4)[..., :3]
                 for mesh in range(len(frames[0]["parts"]))], np.array([frame["tops"] for frame in frames]), drawn["step"])

    def export(self, scene, seed):
        self.write("scene.lua", scene)
        status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", "1", "--record", "run.h5",
                                          "--seed", str(seed))
        self.assertEqual(status, 0, err)
        for name in ("run.html", "run.glb"):
            status, _, err = self.run_program(SMARTSURF, "export", "run.h5", "-o", name, "--fps", "20")
            self.assertEqual(status, 0, err)

    def check(self, scene, seed):
        self.export(scene, seed)
        parts, tops, step = self.drawn_by_page()
        model = Model((self.folder / "run.glb").read_bytes())
        times = np.array(model.json["extras"]["times_s"])
        seen = 0
        for index, node in enumerate(model.json["nodes"]):
            kind, _, place = node["name"].partition(" ")
            if kind not in ("part", "pin"):
                continue
            seen += kind == "part"
            first, second = map(int, place.split(","))
            centre, size, turn = (model.track(index, path, times) for path in ("translation", "scale", "rotation")) \
                if kind == "part" else (model.track(index, "translation", times), None, None)
            if kind == "pin":
                error = np.abs(tops[:, first * 6 + second if "skin" in scene else first * 5 + second] - centre[:, 2])
                self.assertLess(error.max(), 0.008 + step / 2, node["name"])
                continue
            page = parts[first][:, second]
            shown = np.abs(page[:, :3]).max((1, 2)) > 0
            self.assertTrue((shown == (np.abs(size).max(1) > 1e-3)).all(), f"{node['name']}: shown {shown}, {size}")
            x, y, z, w = (turn / np.linalg.norm(turn, axis=1)[:, None]).T
            axes = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
                             [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
                             [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1) * size[:, :, None]
            for name, mine, its in (("axes", without_shear(page[:, :3]), axes), ("centre", page[:, 3], centre)):
                error = np.abs(mine - its) * shown.reshape(-1, *[1] * (mine.ndim - 1))
                frame = np.unravel_index(error.argmax(), error.shape)[0]
                self.assertLess(error.max(), 0.008 + step / 2,
                                f"{node['name']}, frame {frame}: {name}: page {mine[frame]}, view {its[frame]}")
        self.assertEqual(seen, sum(part.shape[1] for part in parts))

    @unittest.skipUnless(NODE, "node is not installed")
    def test_parts_are_where_the_view_draws_them(self):
        for seed in (1, 2, 3):
            for turned in (0, 1):
                with self.subTest(seed=seed, turned=turned):
                    self.check(KINDS.replace("TURNED", str(turned)) + MOTION.replace("CHANNELS", CHANNELS), seed)

    @unittest.skipUnless(NODE, "node is not installed")
    def test_skinned_parts_are_where_the_view_draws_them(self):
        for seed in (1, 2):
            with self.subTest(seed=seed):
                self.check(SKIN + MOTION.replace("CHANNELS", POSE), seed)

    @unittest.skipUnless(NODE, "node is not installed")
    def test_pins_have_the_views_colours(self):
        self.export(PINS + MOTION.replace("CHANNELS", "height = 3"), 1)
        source = (ROOT / "smartsurf/view/model/PinShading.h").read_text()
        lowest, highest, border = (np.array(re.search(name + r"{([^}]*)}", source)[1].replace("F", "").split(","), float)
                                   for name in ("kLowestPinColour", "kHighestPinColour", "kBorderColour"))
        drawn = np.array(self.play(COLOURS)).reshape(6, 7, 4)
        edge = np.ones((6, 7), bool)
        edge[1:-1, 1:-1] = False
        self.assertLess(np.abs(drawn[edge, 1:] - border).max(), 0.002)
        share = np.sqrt(drawn[~edge, :1] / 3)
        self.assertGreater(np.ptp(share), 0.7)
        self.assertLess(np.abs(drawn[~edge, 1:] - lowest - (highest - lowest) * share).max(), 0.02)


if __name__ == "__main__":
    unittest.main()
