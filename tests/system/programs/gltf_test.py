"""smartsurf export -o FILE.glb: the file keeps the rules of glTF 2.0, and its animation is the recording."""
import shutil
import struct

import h5py
import numpy as np

from programs import *

ASSIMP = shutil.which("assimp")
COMPONENTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

SCENE = """
world { dt = 1/240, iterations = 10, control_period = 1/60, ground = false, off_table = 'remove' }
surface { rows = 10, columns = 12, actuator = pin { range = {0, 3}, max_speed = 6 }, border = { height = 4 } }
local function place(k) return {1.5 + 1.7 * k, 2 + random(0, 6), 5 + random(0, 2)} end
local turn = { roll = random(0, 3), pitch = random(0, 3), yaw = random(0, 3) }
sphere { radius = .5, position = place(0), label = 'ball' }
box { size = {1, .8, .6}, position = place(1), orientation = turn }
cylinder { radius = .4, height = 1, position = place(2), orientation = turn }
capsule { radius = .3, height = 1.2, position = place(3), orientation = turn }
cone { radius = .5, height = 1, position = place(4), orientation = turn }
sphere { radius = .4, position = {9, 5, 6}, velocity = {15, 0, 8} }
local heights = {}
on_tick(function(t)
  for cell = 1, cells.rows * cells.columns do heights[cell] = 1 + math.sin(3 * t + .7 * cell) end
  cells:targets('height', heights)
end)
at(0.5, function() sphere { radius = .6, position = {6, 6, 8}, label = 'late' } end)
"""


class Model:
    """A parsed .glb file."""

    def __init__(self, data):
        magic, version, size = struct.unpack_from("<III", data)
        text_size, text_kind = struct.unpack_from("<II", data, 12)
        assert (magic, version, size, text_kind, text_size % 4) == (0x46546C67, 2, len(data), 0x4E4F534A, 0)
        self.json = json.loads(data[20:20 + text_size])
        binary_size, binary_kind = struct.unpack_from("<II", data, 20 + text_size)
        self.binary = data[28 + text_size:]
        assert (binary_kind, binary_size) == (0x004E4942, len(self.binary)) and self.json["buffers"][0]["byteLength"] == binary_size

    def values(self, index):
        """An accessor's values, one row an element; its bounds are checked."""
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind = {5126: np.float32, 5125: np.uint32}[accessor["componentType"]]
        width = COMPONENTS[accessor["type"]]
        assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= len(self.binary)
        assert view["byteLength"] == 4 * width * accessor["count"] > 0
        array = np.frombuffer(self.binary, kind, width * accessor["count"], view["byteOffset"]).reshape(-1, width)
        if "min" in accessor:
            assert np.allclose(array.min(0), accessor["min"]) and np.allclose(array.max(0), accessor["max"])
        return array

    def track(self, node, path, times):
        """The values of a node's property at these times, interpolated as the specification says."""
        animation = self.json.get("animations", [{"channels": []}])[0]
        for channel in animation["channels"]:
            if channel["target"] == {"node": node, "path": path}:
                sampler = animation["samplers"][channel["sampler"]]
                keys, values = self.values(sampler["input"])[:, 0], self.values(sampler["output"])
                assert (np.diff(keys) > 0).all() and len(keys) == len(values)
                if sampler["interpolation"] == "STEP":
                    return values[np.searchsorted(keys, times + 1e-6, side="right").clip(1) - 1]
                return np.stack([np.interp(times, keys, component) for component in values.T], 1)
        return np.tile(np.array(self.json["nodes"][node][path]), (len(times), 1))


class Gltf(ProgramTest):
    def export(self, scene, until, seed=1, options=()):
        self.write("scene.lua", scene)
        status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", str(until), "--record", "run.h5",
                                          "--seed", str(seed))
        self.assertEqual(status, 0, err)
        status, _, err = self.run_program(SMARTSURF, "export", "run.h5", "-o", "run.glb", *options)
        self.assertEqual(status, 0, err)
        with h5py.File(self.folder / "run.h5") as file:
            run = {name: file[name][:] for name in ("time", "objects/position", "objects/orientation", "surface/changes/end",
                                                      "surface/changes/cell", "surface/changes/value") if name in file}
        return Model((self.folder / "run.glb").read_bytes()), run

    def test_animation_is_the_recording(self):
        for seed in (1, 2, 3):
            model, run = self.export(SCENE, 2, seed, ["--fps", "1000"])
            times, position, orientation = run["time"], run["objects/position"], run["objects/orientation"]
            nodes = {node["name"]: index for index, node in enumerate(model.json["nodes"])}
            for name, id in (("ball 0", 0), ("object 1", 1), ("object 4", 4), ("object 5", 5), ("late 6", 6)):
                there = np.isfinite(position[:, id, 0])
                size = model.track(nodes[name], "scale", times - times[0])
                self.assertTrue((size == there[:, None]).all(), f"{name}: exists when it should not, or does not")
                moved = model.track(nodes[name], "translation", times - times[0])[there]
                self.assertLess(np.abs(moved - position[there, id]).max(), 0.0011, name)
                turned = model.track(nodes[name], "rotation", times - times[0])[there]
                turned /= np.linalg.norm(turned, axis=1)[:, None]
                same = np.abs((turned * orientation[there, id]).sum(1)).clip(0, 1)
                self.assertLess(np.degrees(2 * np.arccos(same)).max(), 0.4, name)
            self.assertFalse(np.isfinite(position[-1, 5, 0]), "the object off the table is removed")
            heights, cells, begin = np.zeros((len(times), 10, 12)), np.zeros(120), 0
            for frame, end in enumerate(run["surface/changes/end"]):
                cells[run["surface/changes/cell"][begin:end]] = run["surface/changes/value"][begin:end]
                heights[frame], begin = cells.reshape(10, 12), end
            for row, column in ((0, 0), (4, 7), (8, 2)):
                z = model.track(nodes[f"pin {row},{column}"], "translation", times - times[0])
                self.assertLess(np.abs(z[:, 2] - heights[:, row, column]).max(), 0.003)
                self.assertEqual((z[0, 0], z[0, 1]), (column, 9 - row))

    def test_meshes_have_the_objects_sizes_and_face_outwards(self):
        model, _ = self.export(SCENE, 0.1)
        half = {"sphere": (.5, .5, .5), "box": (.5, .4, .3), "cylinder": (.4, .4, .5), "capsule": (.3, .3, .6)}
        seen = set()
        for mesh in model.json["meshes"]:
            part = mesh["primitives"][0]
            points, normals = model.values(part["attributes"]["POSITION"]), model.values(part["attributes"]["NORMAL"])
            triangles = model.values(part["indices"]).reshape(-1, 3)
            self.assertLess(triangles.max(), len(points))
            self.assertTrue(np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4))
            a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
            volume = (np.cross(a, b) * c).sum() / 6
            self.assertGreater(volume, 0, f"{mesh['name']}: faces inwards")
            if mesh["name"] in half and mesh["name"] not in seen:
                seen.add(mesh["name"])
                self.assertTrue(np.allclose(points.max(0), half[mesh["name"]], rtol=0.01), mesh["name"])
        self.assertEqual(seen, set(half))

    def test_every_mechanism_is_exported(self):
        for name in ("ball", "rotor", "tilt", "delta", "magnet", "tips", "skin", "air_jet"):
            scene = (ROOT / f"scripts/examples/{name}.lua").read_text()
            model, _ = self.export(scene, 0.2)
            for accessor in range(len(model.json["accessors"])):
                self.assertTrue(np.isfinite(model.values(accessor)).all(), name)
            if ASSIMP:
                status, out, err = self.run_program(ASSIMP, "info", "run.glb")
                self.assertEqual(status, 0, out + err)

    def test_arrows_and_plumes_that_are_weak_at_first_are_exported(self):
        for actuator, channel, most in (("force_field {}", "fx", 10), ("air_jet {}", "flow", 100)):
            model, run = self.export(f"""
                surface {{ rows = 4, columns = 5, actuator = {actuator} }}
                on_tick(function(t) cells:target('{channel}', 2, t < 0.5 and 3 or 4, {most} * math.min(1, 2 * t)) end)
                """, 1, options=["--fps", "60"])
            times = run["time"] - run["time"][0]
            sizes = {tuple(node["translation"][:2]): np.abs(model.track(index, "scale", times)).max(1)
                     for index, node in enumerate(model.json["nodes"]) if node["name"].startswith("part ")}
            shown = {place for place, size in sizes.items() if place[1] == 2 and size[0] < 0.5 < 0.05 + size.max() - size.min() + 0.4}
            self.assertTrue({(2, 2), (3, 2)} <= {(round(x), round(y)) for x, y in shown}, f"{actuator}: {sizes}")

    def test_mounts_of_turning_rotors_stand_still(self):
        model, run = self.export("""
            surface { rows = 3, columns = 3, actuator = rotor { command = 'rate', axis = {0, 1, 0}, half_axes = {.4, .4, .6}, axle = -.5 } }
            on_tick(function() for row = 1, 3 do for column = 1, 3 do cells:target('rate', row, column, 2) end end end)
            """, 2, options=["--fps", "60"])
        top = run["surface/changes/value"][run["surface/changes/cell"] == 4]
        self.assertGreater(np.ptp(top), 0.15, "the rotor's top rises and falls")
        mount = next(index for index, node in enumerate(model.json["nodes"]) if node["name"] == "pin 1,1")
        z = model.track(mount, "translation", run["time"] - run["time"][0])[:, 2]
        self.assertLess(np.ptp(z), 0.004)

    def test_wrong_name_is_refused(self):
        self.write("scene.lua", "surface { rows = 4, columns = 4, actuator = pin {} }")
        self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", "0.1", "--record", "run.h5")
        for name, message in (("run.gltf", "export -o run.gltf: the name must end in .html, .glb, .usd, .usda, .usdc, .rrd or .mcap"),):
            self.assertEqual(self.run_program(SMARTSURF, "export", "run.h5", "-o", name)[::2], (2, f"smartsurf: {message}\n"))


if __name__ == "__main__":
    unittest.main()
