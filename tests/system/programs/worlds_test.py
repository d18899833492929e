"""smartsurf run --worlds N: independent worlds in one process, each identical to a single run."""
from programs import *

TABLE = """
surface { rows = 8, columns = 8, actuator = pin {}, border = { height = 3 } }
for _ = 1, 4 do sphere { radius = 0.8, position = {random(1, 6), random(1, 6), 3} } end
if option('fail_at', 0) == random(1, 1) then error('asked to fail') end
on_tick(function(t, n) cells:target('height', 4, 4, 2 * (n % 60) / 60) end)
"""


class Worlds(ProgramTest):
    def worlds(self, experiment, count, *flags):
        stats = self.folder / "worlds.json"
        result = self.run_program(SMARTSURF, "run", experiment, "--worlds", str(count), "--stats", str(stats), *flags)
        return result, json.loads(stats.read_text()) if stats.exists() else None

    def test_each_world_equals_single_run_with_its_seed(self):
        experiment = self.write("table.lua", TABLE)
        (status, _, err), all = self.worlds(experiment, 3, "--no-controller", "--ticks", "200", "--seed", "5",
                                            "--record", "run.h5")
        self.assertEqual(status, 0, err)
        self.assertEqual(all["worlds"], 3)
        self.assertAlmostEqual(all["simulated_s"], 10.0)
        for k, run in enumerate(all["runs"]):
            self.assertEqual(run["seed"], 5 + k)
            alone = self.folder / "alone.json"
            self.assertEqual(self.run_program(SMARTSURF, "run", experiment, "--no-controller", "--ticks", "200",
                                              "--seed", str(5 + k), "--stats", str(alone))[0], 0)
            self.assertEqual(run["state_hash"], json.loads(alone.read_text())["state_hash"])
            status, out, _ = self.run_program(SMARTSURF, "info", str(self.folder / f"run-{k}.h5"))
            self.assertEqual(status, 0)
            self.assertIn(run["state_hash"], out)
        self.assertEqual(len({run["state_hash"] for run in all["runs"]}), 3)

    def test_each_world_has_its_own_controller(self):
        (status, _, err), all = self.worlds(SORT_LUA, 2, "--controller", SORT_APS, "--ticks", "60", "--shm", self.shm)
        self.assertEqual(status, 0, err)
        self.assertEqual([run["state_hash"] for run in all["runs"]],
                         [self.run_sort("--ticks", "60", seed=seed)["state_hash"] for seed in (1, 2)])
        self.assertEqual(list(pathlib.Path("/dev/shm").glob(f"smartsurf.{self.shm}*")), [])

    def test_controllers_may_attach_in_any_order(self):
        messages = self.folder / "messages.txt"
        with messages.open("w") as file:
            surface = self.start(SMARTSURF, "run", SORT_LUA, "--worlds", "2", "--ticks", "30", "--shm", self.shm,
                                 stderr=file)
        for k in (1, 0):
            # A world that finds a controller attached when it first looks does not wait.
            self.wait_for(lambda: f"world {k}: waiting for a controller" in messages.read_text(), "the announcement")
            controller = self.start(APRON, "run", SORT_APS, "--shm", f"{self.shm}-{k}")
            self.assertEqual(self.finish(controller)[0], 0)
        self.assertEqual(self.finish(surface)[0], 0, messages.read_text())

    def test_failing_world_does_not_stop_others(self):
        controller = self.write("two.sh", "case $SMARTSURF_SHM in *-0) exit 7;; *) exec \"$1\" run \"$2\" --shm "
                                "$SMARTSURF_SHM;; esac\n")
        (status, _, err), all = self.worlds(SORT_LUA, 2, "--controller", f"sh {controller} {APRON} {SORT_APS}",
                                            "--ticks", "30")
        self.assertEqual(status, 1, err)
        self.assertIn("world 0: the controller ended with exit status 7", err)
        self.assertEqual([run["ticks"] for run in all["runs"]], [0, 30])

    def test_invalid_input_reports_one_line(self):
        experiment = self.write("table.lua", TABLE)
        for flags, message in ((("--worlds", "0"), "--worlds"), (("--worlds", "2", "--window"), "--record"),
                               (("--worlds", "2", "--set", "fail_at=1"), "asked to fail")):
            status, _, err = self.run_program(SMARTSURF, "run", experiment, "--no-controller", "--ticks", "1", *flags)
            self.assertEqual(status, 2, err)
            self.assertIn(message, err)
            self.assertEqual(len(err.strip().splitlines()), 1, err)

    def test_signal_ends_all_worlds(self):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--worlds", "3", "--shm", self.shm)
        for k in range(3):
            self.wait_for(self.segment(f"{self.shm}-{k}").exists, "the segment")
        surface.send_signal(signal.SIGTERM)
        self.assertEqual(self.finish(surface)[0], 128 + signal.SIGTERM)
        self.assertEqual(list(pathlib.Path("/dev/shm").glob(f"smartsurf.{self.shm}*")), [])


if __name__ == "__main__":
    unittest.main()
