"""smartsurf export -o FILE.usd, .rrd, .mcap: the format's own reader finds the recording in the file. smartsurf fmu: a program
that imports the unit sees the experiment, to the bit."""
import random
import re
import textwrap
import xml.etree.ElementTree
import zipfile

import h5py
import numpy as np

from programs import *

VENV = ROOT / "build/formats"
PACKAGE = BIN.parent / "python"
EXPORT = [SMARTSURF, "export"]


def needs(package):
    there = list(VENV.glob(f"lib/python3*/site-packages/{package}/__init__.py"))
    return unittest.skipUnless(there, f"{package} is not installed: scripts/setup --formats")


def scene(seed):
    """Objects of all kinds on moving pins; one leaves, one comes later, one has the name of a pin."""
    draw = random.Random(seed)
    rows, columns = draw.randint(4, 12), draw.randint(4, 12)
    place = lambda: f"{{{draw.uniform(0, columns - 1):.2f}, {draw.uniform(0, rows - 1):.2f}, {draw.uniform(5, 8):.2f}}}"
    shapes = ("sphere { radius = .5,", "box { size = {1, .8, .6},", "cylinder { radius = .4, height = 1,",
              "capsule { radius = .3, height = 1.2,", "cone { radius = .5, height = 1,")
    objects = "\n".join(f"{draw.choice(shapes)} position = {place()}, label = '{label}', orientation = {{ roll = {draw.uniform(0, 3):.2f} }} }}"
                        for label in ("ball", "pin", "two words", ""))
    return textwrap.dedent(f"""
        world {{ control_period = 1/60, ground = false, off_table = 'remove' }}
        surface {{ rows = {rows}, columns = {columns}, actuator = pin {{ range = {{0, 3}}, max_speed = 6 }}, border = {{ height = 4 }},
                  sensors = {{ proximity {{}}, pressure {{}} }} }}
        record {{ sensors = true, actuators = true }}
        """) + objects + textwrap.dedent("""
        sphere { radius = .4, position = {1, 1, 6}, velocity = {-30, 0, 8} }
        metric('height/u', function() local x, y, z = object(0):position() return z end)
        local heights = {}
        on_tick(function(t)
          for cell = 1, cells.rows * cells.columns do heights[cell] = 1 + math.sin(3 * t + .7 * cell) end
          cells:targets('height', heights)
        end)
        at(0.3, function() sphere { radius = .6, position = {2, 2, 8}, label = 'late' } end)
        """)


class FormatTest(ProgramTest):
    def run_python(self, *command):
        done = subprocess.run([str(c) for c in command], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                              env={**os.environ, "PYTHONPATH": str(PACKAGE), "SMARTSURF_PYTHON": str(VENV / "bin/python"),
                                   "HOME": str(self.folder), "PYTHONDONTWRITEBYTECODE": "1"})
        return done.returncode, done.stdout, done.stderr

    def read(self, script):
        """What a script of the format's own library prints as JSON."""
        status, out, err = self.run_python(VENV / "bin/python", "-c", textwrap.dedent(script))
        self.assertEqual(status, 0, err)
        return json.loads(out.splitlines()[-1])


class Formats(FormatTest):
    def record(self, text):
        self.write("scene.lua", text)
        status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", "1", "--record", "run.h5")
        self.assertEqual(status, 0, err)

    def export(self, extension, fps=1000):
        status, out, err = self.run_python(*EXPORT, "run.h5", "-o", f"run{extension}", "--fps", fps)
        self.assertEqual((status, out, err), (0, "", ""))

    def check(self, extension, script):
        """script prints {object: [[t, x, y, z, shown], …]}, and perhaps {channel: [[t, sum], …]} and {metric: [[t, value], …]}."""
        for seed in (1, 2):
            self.record(scene(seed))
            self.export(extension)
            found = self.read(script)
            with h5py.File(self.folder / "run.h5") as file:
                time, position = file["time"][:], file["objects/position"][:]
                names = [f"{label or b'object'!s}" for label in file["objects/label"][:]]
                channels = {f"{group}/{name}": file[group][name][:].reshape(len(time), -1).sum(1)
                            for group in ("sensors", "actuators") for name in file[group]}
                metric = file["metrics/height%2Fu"][:]
            self.assertEqual(len(found["objects"]), position.shape[1], names)
            for name, rows in found["objects"].items():
                rows, id = np.array(rows, float), int(name.rsplit("_", 1)[1])
                there = np.isfinite(position[:, id, 0])
                at = np.interp(rows[:, 0], time - time[0], np.arange(len(time))).round().astype(int)
                self.assertTrue((rows[:, 4].astype(bool) == there[at]).all(), f"{name}: shown when it is not there, or not shown")
                kept = there[at]
                self.assertGreater(kept.sum(), 1, name)
                self.assertLess(np.abs(rows[kept, 1:4] - position[at[kept], id]).max(), 0.0011, name)
            for name, rows in found.get("channels", {}).items():
                rows = np.array(rows)
                self.assertEqual(len(rows), len(time))
                self.assertTrue(np.allclose(rows[:, 1], channels.pop(name), rtol=1e-5, atol=1e-3), name)
            if "channels" in found:
                self.assertEqual(channels, {})
            self.assertTrue(np.allclose(np.array(found["metric"])[:, 1], metric))

    @needs("pxr")
    def test_usd(self):
        self.check(".usdc", """
            import json
            from pxr import Usd, UsdGeom, UsdValidation
            stage = Usd.Stage.Open('run.usdc')
            errors = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators()).Validate(stage)
            assert not errors, [e.GetMessage() for e in errors]
            codes, second = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1, 5), stage.GetTimeCodesPerSecond()
            metric = stage.GetPrimAtPath('/table').GetAttribute('metrics:height_u')
            objects = {}
            for prim in stage.GetPrimAtPath('/table/objects').GetChildren():
                move, rows = UsdGeom.Xformable(prim), []
                samples = {c for op in move.GetOrderedXformOps() for c in op.GetTimeSamples()} | set(prim.GetAttribute('visibility').GetTimeSamples())
                for code in sorted(samples):
                    shown = UsdGeom.Imageable(prim).ComputeVisibility(code) != 'invisible'
                    rows.append([code / second, *move.GetLocalTransformation(code).ExtractTranslation(), shown])
                objects[prim.GetName()] = rows
            pins = [prim for prim in stage.GetPrimAtPath('/table/cells').GetChildren() if prim.GetName().startswith('pin')]
            positions = UsdGeom.PointInstancer(pins[0]).GetPositionsAttr()
            assert len(positions.GetTimeSamples()) > 10 and positions.Get(0) != positions.Get(stage.GetEndTimeCode())
            print(json.dumps({'objects': objects, 'metric': [[c, metric.Get(c)] for c in metric.GetTimeSamples()]}))
            """)

    @needs("rerun")
    def test_rerun(self):
        self.check(".rrd", """
            import json
            import rerun.chunk
            objects, channels, metric = {}, {}, []
            for chunk in rerun.chunk.RrdReader('run.rrd').stream():
                if chunk.is_static: continue
                path, batch = chunk.entity_path.strip('/').split('/'), chunk.to_record_batch()
                times = [t / 1e9 for t in batch.column('time').cast('int64').to_pylist()]
                columns = {name: batch.column(name).to_pylist() for name in batch.schema.names if ':' in name}
                for name, values in columns.items():
                    if path[:2] == ['table', 'objects'] and name == 'Transform3D:translation':
                        objects.setdefault(path[2], []).extend(
                            [t, *v[0], s[0][0] > 0] for t, v, s in zip(times, values, columns['Transform3D:scale']))
                    elif name == 'Tensor:data':
                        channels.setdefault('/'.join(path), []).extend([t, sum(v[0]['buffer'])] for t, v in zip(times, values))
                    elif path[0] == 'metrics' and name == 'Scalars:scalars':
                        metric.extend([t, v[0]] for t, v in zip(times, values))
            order = lambda rows: sorted(rows)
            print(json.dumps({'objects': {n: order(r) for n, r in objects.items()}, 'channels': {n: order(r) for n, r in channels.items()},
                              'metric': order(metric)}))
            """)

    @needs("mcap")
    def test_mcap(self):
        self.check(".mcap", """
            import json, struct
            from mcap.reader import make_reader
            from mcap_ros2.decoder import DecoderFactory
            objects, shown, channels, metric = {}, {}, {}, []
            with open('run.mcap', 'rb') as file:
                for schema, channel, message, content in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
                    t = message.log_time / 1e9
                    if channel.topic == '/objects':
                        for marker in content.markers: shown[marker.header.frame_id] = marker.action == 0
                        for name in objects:
                            if objects[name] and objects[name][-1][0] == t: objects[name][-1][4] = shown[name]
                    elif channel.topic == '/tf':
                        for one in content.transforms:
                            v = one.transform.translation
                            objects.setdefault(one.child_frame_id, []).append([t, v.x, v.y, v.z, shown.get(one.child_frame_id, False)])
                    elif schema.name == 'sensor_msgs/msg/Image':
                        data = bytes(content.data)
                        assert len(data) == content.height * content.step and content.encoding == '32FC1', content.encoding
                        channels.setdefault(channel.topic[1:], []).append([t, sum(struct.unpack(f'<{len(data) // 4}f', data))])
                    elif channel.topic == '/metrics/height/u':
                        metric.append([t, content.data])
            print(json.dumps({'objects': objects, 'channels': channels, 'metric': metric}))
            """)

    @needs("mcap")
    def test_mcap_has_meshes_of_moving_parts_once(self):
        """Wheels turn in every frame, and arms of deltas, whose scale has rounding errors; force shows by the scale of arrows."""
        scene = """
            record {{ sensors = true }}
            surface {{ rows = 5, columns = 6, actuator = {actuator}, sensors = {{ colour {{}} }} }}
            on_tick(function(t) for c = 1, 6 do cells:target('{channel}', 2, c, {value}) end end)
            """
        for actuator, channel, value in (("wheels { top = 0.8, max_spin = 20 }", "spin_a", "9"),
                                           ("delta { workspace = { radius = 0.8, z = {0.6, 1.8} } }", "x", "0.5 * math.sin(6 * t)"),
                                           ("force_field {}", "fx", "2 + 6 * t")):
            self.record(textwrap.dedent(scene).format(actuator=actuator, channel=channel, value=value))
            self.export(".mcap")
            frames, messages, turned, sizes, images = self.read("""
                import json
                from mcap.reader import make_reader
                from mcap_ros2.decoder import DecoderFactory
                messages, turned, sizes, images, times = [], {}, {}, 0, set()
                with open('run.mcap', 'rb') as file:
                    for schema, channel, message, content in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
                        times.add(message.log_time)
                        if channel.topic == '/cells':
                            messages.append(len(content.markers))
                            for marker in content.markers:
                                if marker.type != 11: continue  # pins, which move
                                assert marker.points and marker.frame_locked and not marker.text and not marker.colors
                                sizes.setdefault(f'{marker.ns}/{marker.id}', []).append(marker.scale.x * marker.scale.z)
                        elif channel.topic == '/tf':
                            for one in content.transforms:
                                q = one.transform.rotation
                                turned.setdefault(one.child_frame_id, set()).add((q.x, q.y, q.z, q.w))
                        elif schema.name == 'sensor_msgs/msg/Image':
                            images += 1
                            assert len(content.data) == content.height * content.step and content.encoding == '32FC3', content.encoding
                print(json.dumps([len(times), messages, {n: len(q) for n, q in turned.items()}, sizes, images]))
                """)
            self.assertEqual((frames, images), (61, 61))
            if channel == "spin_a":
                self.assertEqual(len(messages), 1, "meshes are repeated")
                self.assertEqual(sum(n > 50 for n in turned.values()), 6, turned)  # of the row that is driven
            elif channel == "x":
                self.assertEqual({len(track) for track in sizes.values()}, {1}, "markers whose scale does not change are repeated")
                self.assertGreater(sum(n > 50 for n in turned.values()), 6)
            else:
                flowing = [track for track in sizes.values() if len(track) > 10]
                self.assertEqual(len(flowing), 6, {n: len(s) for n, s in sizes.items()})
                for track in flowing:
                    self.assertEqual(track, sorted(track))
                self.assertLess(sum(messages), messages[0] + 6 * frames + 1, "markers that do not change are repeated")

    @needs("mcap")
    def test_mistakes_are_one_line(self):
        self.record("surface { rows = 4, columns = 4, actuator = pin {} }")
        self.write("broken.h5", "no recording")
        for arguments, word in ((["broken.h5", "-o", "a.mcap"], "broken.h5"), (["none.h5", "-o", "a.mcap"], "none.h5"),
                                (["run.h5", "-o", "a.xyz"], ".mcap"), (["run.h5", "-o", "none/a.mcap"], "no folder none"),
                                (["run.h5", "-o", "a.mcap", "--fps", "-1"], "--fps")):
            status, out, err = self.run_python(*EXPORT, *arguments)
            self.assertEqual((status, out, len(err.splitlines())), (2, "", 1), err)
            self.assertIn(word, err)
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["broken.h5", "run.h5", "scene.lua"])


TABLE = """
local count = option('count', 3)
surface { rows = 6, columns = 9, actuator = pin { range = {0, 2}, max_speed = 5 }, sensors = { pressure {}, colour {} } }
for i = 1, count do sphere { radius = .5, position = {2 * i, random(1, 4), 4} } end
success(function(t) return t > 0.5 end)
"""
# A world whose number of objects depends on the seed, and which counts the steps of its script.
SEEDED = """
surface { rows = 2, columns = 2, actuator = pin { range = {0, 2} } }
for i = 1, random() < 0.5 and 1 or 2 do sphere { radius = .3, position = {0, i - 1, 4} } end
success(function(t, tick) return tick == 3 end)
reward(function(t, tick) return tick end)
"""


class Fmu(FormatTest):
    def test_value_references_are_those_of_the_library(self):
        self.write("table.lua", TABLE)
        self.assertEqual(self.run_program(SMARTSURF, "fmu", "table.lua", "-o", "table.fmu"), (0, "", ""))
        with zipfile.ZipFile(self.folder / "table.fmu") as unit:
            variables = xml.etree.ElementTree.fromstring(unit.read("modelDescription.xml")).find("ModelVariables")
        written = {variable.get("name").removeprefix("objects."): int(variable.get("valueReference")) for variable in variables}
        for kind in ("actuator", "sensor"):
            channels = sorted(reference for name, reference in written.items() if name.startswith(kind + "s."))
            self.assertEqual(channels, list(range(channels[0], channels[0] + len(channels))))
            written = {name: reference for name, reference in written.items() if not name.startswith(kind + "s.")}
            written["first_" + kind] = channels[0]
        library, following = {}, 0
        source = (ROOT / "smartsurf/library/fmu/Fmu.cpp").read_text()
        for name, given in re.findall(r"k(\w+)(?: = (\d+))?", re.search(r"enum Reference[^{]*\{(.*?)\}", source, re.S)[1]):
            library[re.sub(r"(?<=.)([A-Z])", r"_\1", name).lower()] = int(given or following)
            following = int(given or following) + 1
        self.assertEqual(written, library)

    @needs("fmpy")
    def test_unit_is_the_experiment(self):
        self.write("table.lua", TABLE)
        pack = [SMARTSURF, "fmu", "table.lua", "-o"]
        for name, more in (("a.fmu", ()), ("b.fmu", ()), ("c.fmu", ("--set", "count=2", "--seed", "7"))):
            self.assertEqual(self.run_python(*pack, name, *more), (0, "", ""))
        self.assertEqual((self.folder / "a.fmu").read_bytes(), (self.folder / "b.fmu").read_bytes())
        found = self.read("""
            import ctypes, json
            import numpy as np, fmpy, fmpy.validation, smartsurf
            results = []
            for name, options in (('a.fmu', {}), ('c.fmu', {'count': 2})):
                problems = fmpy.validation.validate_fmu(name)
                assert not problems, problems
                description, folder = fmpy.read_model_description(name), fmpy.extract(name)
                variables = {v.name: v for v in description.modelVariables}
                refer = lambda name: [variables[name].valueReference]
                unit = fmpy.instantiate_fmu(folder, description, 'CoSimulation')
                if name == 'a.fmu': unit.setUInt64(refer('seed'), [7])  # c.fmu starts with it
                unit.enterInitializationMode()
                unit.exitInitializationMode()
                table, draw = smartsurf.Simulation('table.lua', seed=7, set=options), np.random.default_rng(1)
                tick = lambda: unit.getUInt64(refer('tick'))[0]
                state = lambda: (unit.getUInt64(refer('state_hash'))[0], tick(), unit.getBoolean(refer('success'))[0])
                def step(ticks, at):  # with new inputs
                    heights = draw.uniform(-1, 3, (6, 9)).astype('f4')
                    unit.setFloat32(refer('actuators.height'), heights.reshape(-1).tolist())
                    unit.doStep(currentCommunicationPoint=at * table.period, communicationStepSize=ticks * table.period)
                    for _ in range(ticks): ended = table.success or table.step({'height': heights})[1]
                    assert state() == (table.state_hash, table.tick, ended), (state(), table.tick, ended)
                    assert unit.getBoolean(refer('terminated'))[0] == ended
                    for channel in ('pressure', 'colour'):
                        values = unit.getFloat32(refer('sensors.' + channel), nValues=table.sensors[channel].size)
                        assert (np.array(values, 'f4') == table.sensors[channel].reshape(-1)).all(), channel
                    position = np.array(unit.getFloat32(refer('objects.position'), nValues=table.objects['position'].size), 'f4')
                    assert (position == table.objects['position'].reshape(-1)).all()
                at = 0
                for ticks in (1, 3, 1, 20, 2):
                    step(ticks, at)
                    at += ticks
                saved, kept, before = unit.getFMUState(), table.save(), state()
                step(5, at)
                unit.setFMUState(saved)
                table.restore(kept)
                assert state() == before
                step(9, at)
                unit.freeFMUState(saved)
                results.append([state()[2], at])
                try:
                    unit.setFloat32(refer('actuators.height'), [1.0])
                    raise AssertionError('accepted')
                except fmpy.fmi1.FMICallException: pass
                kept = unit.getFMUState()
                unit.reset()
                unit.setUInt64(refer('seed'), [9])
                other = state()
                unit.setFMUState(kept)
                assert unit.getUInt64(refer('seed')) == [7]
                unit.freeFMUState(kept)
                unit.reset()
                first = int(variables['seed'].start)
                fresh = smartsurf.Simulation('table.lua', seed=first, set=options)
                assert unit.getUInt64(refer('seed')) == [first] and other[1] == 0
                assert state()[:2] == (fresh.state_hash, 0), (state(), fresh.state_hash)
                unit.terminate()
                unit.freeInstance()
            print(json.dumps(results))
            """)
        self.assertEqual(found, [[True, 27], [True, 27]])

    @needs("fmpy")
    def test_inputs_and_seeds_are_those_of_the_initialization(self):
        self.write("seeded.lua", SEEDED)
        self.assertEqual(self.run_python(SMARTSURF, "fmu", "seeded.lua", "-o", "seeded.fmu", "--seed", str(2**64 - 1)), (0, "", ""))
        found = self.read("""
            import json, re
            import fmpy, smartsurf
            count = lambda seed: len(smartsurf.Simulation('seeded.lua', seed=seed).objects['id'])
            description, folder = fmpy.read_model_description('seeded.fmu'), fmpy.extract('seeded.fmu')
            variables = {v.name: v for v in description.modelVariables}
            refer = lambda name: [variables[name].valueReference]
            own = int(variables['seed'].start)
            same = next(s for s in range(100) if s != own and count(s) == count(own))
            other = next(s for s in range(100) if count(s) != count(own))
            logged = []
            log = fmpy.fmi3.fmi3LogMessageCallback(lambda instance, status, category, message: logged.append(message.decode()))
            unit = fmpy.instantiate_fmu(folder, description, 'CoSimulation', logger=log)
            def refused(seed):
                try:
                    unit.setUInt64(refer('seed'), [seed])
                except fmpy.fmi1.FMICallException as error: return True
            try: unit.enterInitializationMode(startTime=1.5)
            except fmpy.fmi1.FMICallException: pass
            assert logged == ['startTime = 1.500000: must be 0: the experiment starts there'], logged
            assert own == 2**64 - 1
            unit.enterInitializationMode()
            unit.setFloat32(refer('actuators.height'), [1.5, 1.5, 1.5, 1.5])
            assert refused(other) and unit.getUInt64(refer('seed')) == [own]
            unit.setUInt64(refer('seed'), [same])
            assert unit.getFloat32(refer('actuators.height'), nValues=4) == [1.5] * 4
            unit.exitInitializationMode()
            table = smartsurf.Simulation('seeded.lua', seed=same)
            unit.doStep(currentCommunicationPoint=0, communicationStepSize=table.period)
            table.step(1.5)
            assert unit.getUInt64(refer('state_hash')) == [table.state_hash]
            assert refused(same) and unit.getUInt64(refer('tick')) == [1]
            ends = []
            for at in (1, 11):
                unit.doStep(currentCommunicationPoint=at * table.period, communicationStepSize=10 * table.period)
                ends.append([unit.getBoolean(refer('terminated'))[0], unit.getBoolean(refer('success'))[0],
                             unit.getUInt64(refer('tick'))[0], unit.getFloat64(refer('reward'))[0]])
            unit.reset()
            unit.setUInt64(refer('seed'), [same])
            ends.append(unit.getFloat32(refer('actuators.height'), nValues=4))
            unit.freeInstance()
            print(json.dumps(ends))
            """)
        self.assertEqual(found, [[True, True, 3, 3.0], [True, True, 3, 3.0], [0.0] * 4])

    @needs("fmpy")
    def test_mistakes_are_one_line(self):
        self.write("table.lua", TABLE)
        self.write("broken.lua", "surface { rows = 0, columns = 4, actuator = pin {} }")
        self.write("belt.lua", "extension 'belt.so'\nsurface { actuator = belt {} }")
        self.write("x.fmu", "data")
        self.write("start", TABLE)
        (self.folder / "y.fmu").hardlink_to(self.folder / "x.fmu")
        (self.folder / "table.fmu").symlink_to("table.lua")
        before = {p.name: p.read_bytes() for p in self.folder.iterdir()}
        for arguments, word in ((["none.lua", "-o", "a.fmu"], "none.lua"), (["broken.lua", "-o", "a.fmu"], "broken.lua:1"),
                                (["belt.lua", "-o", "a.fmu"], "belt.lua:1: extension 'belt.so': a unit cannot hold extensions"),
                                (["table.lua", "-o", "a.zip"], ".fmu"), (["table.lua", "-o", "none/a.fmu"], "no folder none"),
                                (["table.lua", "-o", "a.fmu", "--set", "count"], "NAME=VALUE"),
                                (["table.lua", "-o", "a.fmu", "--set", "size=2"], "size"),
                                (["table.lua", "-o", "a.fmu", "--seed", "-1"], "--seed: -1: must be a whole number, 0 to"),
                                (["table.lua", "-o", "a.fmu", "--seed", str(2**64)], "--seed: 18446744073709551616: must be a whole"),
                                (["table.lua", "-o", "a.fmu", "--with", "/etc/passwd"], "below"),
                                (["table.lua", "-o", "a.fmu", "--with", "start"], "start: a unit has a file 'start' of its own"),
                                (["start", "-o", "a.fmu"], "start: a unit has a file 'start' of its own"),
                                (["table.lua", "-o", "x.fmu", "--with", "x.fmu"], "overwrite"),
                                (["table.lua", "-o", "y.fmu", "--with", "x.fmu"], "overwrite"),
                                (["table.lua", "-o", "table.fmu"], "overwrite")):
            status, out, err = self.run_python(SMARTSURF, "fmu", *arguments)
            self.assertEqual((status, out, len(err.splitlines())), (2, "", 1), err)
            self.assertIn(word, err)
        self.assertEqual({p.name: p.read_bytes() for p in self.folder.iterdir()}, before)


if __name__ == "__main__":
    unittest.main()
