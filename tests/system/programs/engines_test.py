"""The second engine: runs, recordings, and smartsurf compare."""
import csv

import h5py

from programs import *

TASKS = ROOT / "scripts/tasks"
SCENE = """
surface { rows = 8, columns = 8, actuator = pin {} }
sphere { radius = 0.6, position = { 3, 3, 0.6 }, label = 'ball' }
box { size = { 1.5, 1.5, 1 }, position = { 5, 5, 0.5 } }
on_finish(function() metric('x', 1) end)
"""


class Engines(ProgramTest):
    def setUp(self):
        super().setUp()
        (self.folder / "scene.lua").write_text(SCENE)

    def require_bullet(self):
        if not has_bullet():
            self.skipTest("this build has no Bullet")

    def test_missing_or_unknown_engine_is_one_line(self):
        for flags in (["--engine", "havok"], *([] if has_bullet() else [["--engine", "bullet"]])):
            status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--ticks", "1", *flags)
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertIn(flags[1], err)
        status, _, err = self.run_program(SMARTSURF, "compare", "scene.lua", "--engines", "native,native")
        self.assertEqual((status, err),
                         (2, "smartsurf: --engines native,native: must be two engines, as native,bullet\n"))

    def test_bullet_refuses_limits_beyond_half_a_turn(self):
        self.require_bullet()
        def script(first, second=""):
            (self.folder / "h.lua").write_text(
                "world { engine = option('engine', 'bullet') }\nsurface { rows = 4, columns = 4 }\n"
                "local b = box { size = {1, 1, 1}, position = {1, 1, 3} }\n"
                f"joint {{ kind = 'hinge', a = b, anchor = {{1, 1, 3}}, axis = {{0, 0, 1}}, limits = {{{first}}} }}\n{second}")
            return lambda *words: self.run_program(SMARTSURF, "run", "h.lua", "--no-controller", "--ticks", "20", *words)
        run = script("-4, 1")
        status, _, err = run()
        self.assertEqual((status, err.count("\n")), (2, 1), err)
        self.assertIn("joint 0: limits = {-4, 1}: a hinge's must be within half a turn, [-pi, pi], on the engine 'bullet'", err)
        self.assertEqual(run("--set", "engine=native")[0], 0)
        later = "at(0.1, function() joint { kind = 'hinge', a = b, anchor = {1, 1, 3}, axis = {0, 0, 1}, limits = {-1, 4} } end)"
        status, _, err = script("-3, 3.1", later)()
        self.assertEqual(status, 2)
        self.assertIn("h.lua:5: limits = {-1, 4}: a hinge's", err)

    def test_recording_names_engine_and_is_verified_on_it(self):
        self.require_bullet()
        hashes = []
        for _ in range(2):
            status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", "0.5",
                                              "--engine", "bullet", "--record", "run.h5")
            self.assertEqual(status, 0, err)
            with h5py.File(self.folder / "run.h5") as file:
                self.assertEqual(file["meta"].attrs["engine"], "bullet")
                self.assertIn("bullet", file["meta/versions"].attrs["physics"])
                hashes.append(list(file["hash"]))
        self.assertEqual(*hashes)
        status, out, err = self.run_program(SMARTSURF, "replay", "run.h5", "--verify")
        self.assertEqual((status, err), (0, ""))
        self.assertIn("identical in 31 frames", out)
        self.assertIn("engine bullet", self.run_program(SMARTSURF, "info", "run.h5")[1])
        with h5py.File(self.folder / "run.h5", "r+") as file:
            file["meta"].attrs["engine"] = "havok"
        status, _, err = self.run_program(SMARTSURF, "replay", "run.h5", "--verify")
        self.assertEqual(status, 2)
        self.assertIn("engine 'havok': this version does not have it", err)

    def test_recording_of_other_physics_is_told_by_version(self):
        status, _, err = self.run_program(SMARTSURF, "run", "scene.lua", "--no-controller", "--until", "0.1",
                                          "--record", "old.h5")
        self.assertEqual(status, 0, err)
        with h5py.File(self.folder / "old.h5", "r+") as file:
            file["meta/versions"].attrs["physics"] = "0.1.0"
        status, _, err = self.run_program(SMARTSURF, "replay", "old.h5", "--verify")
        self.assertEqual(status, 2)
        self.assertEqual(len(err.splitlines()), 1)
        self.assertIn("recorded with physics 0.1.0", err)

    def test_compare_prints_verdicts_and_writes_figures(self):
        self.require_bullet()
        self.write("scene.lua", SCENE.replace("'ball'", "'3\" ball, red'"))
        status, out, err = self.run_program(SMARTSURF, "compare", "scene.lua", "--engines", "native,bullet", "--until",
                                            "1", "--out", "results")
        self.assertEqual(status, 0, err)
        self.assertIn("2 of 2 objects stay within 0.1 u for 1.000 s", out)
        self.assertRegex(out, r'object 0 \(3" ball, red, 1.2 u\): within 0.1 u to the end, .*; contact load 8\.\d+ and 8\.\d+')
        self.assertIn("metric x: 1 and 1\n", out)
        for figure in ("distances", "loads", "heights"):
            self.assertIn("</svg>", (self.folder / f"results/{figure}.svg").read_text())
        with open(self.folder / "results/objects.csv", newline="") as file:
            self.assertEqual([(row["id"], row["name"]) for row in csv.DictReader(file)], [("0", '3" ball, red'), ("1", "box")])
        for engine in ("native", "bullet"):
            self.assertTrue((self.folder / f"results/{engine}.h5").exists())

    def test_tasks_run_on_bullet_or_are_refused(self):
        self.require_bullet()
        refused = {}
        for task in sorted(path for path in TASKS.glob("*.lua") if path.with_suffix(".aps").exists()):
            seconds = "2.5" if NIGHTLY and task.stem != "part_sort" else "0.2"  # its solids take minutes
            status, _, err = self.run_program(SMARTSURF, "run", str(task), "--controller", str(task.with_suffix(".aps")),
                                              "--shm", self.shm, "--engine", "bullet", "--until", seconds)
            if status == 2:
                refused[task.stem] = err
            else:
                self.assertEqual(status, 0, f"{task.name}: {err}")
        self.assertEqual(sorted(refused), ["delta_align", "sheet_circle"], refused)
        self.assertIn("remove delta.stiffness", refused["delta_align"])
        self.assertIn("remove surface.skin", refused["sheet_circle"])


if __name__ == "__main__":
    unittest.main()
