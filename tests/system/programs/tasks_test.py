#!/usr/bin/env python3
"""Each task of scripts/tasks at small size: the metrics show that the program solves it."""
from programs import *

TASKS = ROOT / "scripts/tasks"


class Tasks(ProgramTest):
    def run_task(self, name, seconds, *options, seed=1):
        """Runs the task and returns its metrics."""
        stats = self.folder / "stats.json"
        settings = [word for option in options for word in ("--set", option)]
        status, _, err = self.run_program(SMARTSURF, "run", str(TASKS / f"{name}.lua"), "--controller",
                                          str(TASKS / f"{name}.aps"), "--shm", self.shm, "--seed", str(seed), "--until",
                                          str(seconds), "--stats", str(stats), *settings)
        self.assertEqual(status, 0, err)
        return json.loads(stats.read_text())["metrics"]

    def test_every_task_is_tested_and_described(self):
        page = (ROOT / "docs/tasks.md").read_text()
        here = pathlib.Path(__file__).read_text()
        names = [path.stem for path in TASKS.glob("*.lua") if path.with_suffix(".aps").exists()]
        self.assertGreaterEqual(len(names), 13)
        for name in names:
            self.assertIn(f"| `{name}` |", page)
            self.assertIn(f'run_task("{name}"', here)
            strategy = (TASKS / f"{name}.aps").read_text().splitlines()[:3]
            self.assertTrue(strategy[0].startswith("// Strategy:") and strategy[2].startswith("//"), name)

    def test_every_program_is_local(self):
        for program in sorted(TASKS.glob("*.aps")):
            if program.stem in ("push_t", "push_t_pins", "arraybot_lift", "arraybot_flip", "arraybot_relocate", "delta_align"):  # add up what all cells sense
                continue
            status, out, err = self.run_program(APRON, "check", "--local", str(program))
            self.assertEqual((status, "every instruction is local" in out), (0, True), f"{program.name}: {err}")

    def test_each_task_has_a_figure(self):
        status, _, err = self.run_program(str(TASKS / "figures"), "magnets", "--until", "1", "-o", "drawn", "--smartsurf",
                                          SMARTSURF)
        self.assertEqual(status, 0, err)
        self.assertIn("metrics", json.loads((self.folder / "drawn/magnets.json").read_text()))
        self.assertIn("</svg>", (self.folder / "drawn/magnets.svg").read_text())
        status, _, err = self.run_program(str(TASKS / "figures"), "magnet", "--smartsurf", SMARTSURF)
        self.assertEqual(status, 2)
        self.assertTrue(err.startswith("figures: magnet: no such task; there are "), err)
        # The script knows all tasks.
        for path in TASKS.glob("*.aps"):
            if path.with_suffix(".lua").exists():
                self.assertIn(path.stem, err)

    def test_balls_are_sorted_by_size(self):
        metrics = self.run_task("size_sort", 40, "n=32", "count=2")
        self.assertEqual((metrics["purity"], metrics["success"]), (1, 1))
        self.assertAlmostEqual(metrics["objects_per_minute"], 60 * 4 / metrics["time_to_95_s"])

    def test_balls_are_sorted_by_colour(self):
        self.assertEqual(self.run_task("colour_sort", 40, "n=24", "count=3")["purity"], 1)

    def test_flat_parts_are_sorted_by_shape(self):
        self.assertEqual(self.run_task("part_sort", 30, "n=30", "count=2")["purity"], 1)

    def test_ball_reaches_goal_unless_pins_are_stuck(self):
        self.assertLess(self.run_task("relocate", 30)["error_u"], 0.5)
        self.assertGreater(self.run_task("relocate", 25, "stuck=0.3")["error_u"], 0.5)

    def test_ball_follows_three_paths(self):
        metrics = self.run_task("track", 60)
        for path in ("line", "circle", "eight"):
            self.assertLess(metrics[f"rms_{path}_u"], 0.5)

    def test_plate_moves_faster_at_higher_frequency(self):
        slow = self.run_task("waves", 3, "frequency=1")["speed_u_s"]
        fast = self.run_task("waves", 3, "frequency=4")["speed_u_s"]
        self.assertGreater(slow, 0.3)
        self.assertGreater(fast, 2 * slow)

    def test_balls_move_in_parallel_past_a_bystander(self):
        metrics = self.run_task("parallel", 30)
        self.assertEqual(metrics["success"], 1)
        self.assertLess(metrics["bystander_moved_u"], 0.1)

    def test_packages_leave_through_their_exits(self):
        metrics = self.run_task("packages", 16, "count=6")
        self.assertEqual((metrics["delivered"], metrics["wrong_exit"], metrics["collisions"]), (1, 0, 0))

    def test_parcels_leave_through_their_exits(self):
        metrics = self.run_task("parcels", 45, "count=24")
        self.assertEqual((metrics["delivered"], metrics["wrong_exit"]), (1, 0))

    def test_tee_covers_its_goal(self):
        metrics = self.run_task("push_t", 25)
        self.assertEqual(metrics["success"], 1)
        self.assertLess(metrics["error_u"], 0.2)
        self.assertLess(metrics["angle_error_deg"], 3)

    def test_tee_slides_into_its_mould(self):
        metrics = self.run_task("push_t_pins", 40, seed=2)
        self.assertEqual(metrics["success"], 1)
        self.assertLess(metrics["error_u"], 0.25)
        self.assertLess(metrics["angle_error_deg"], 3)

    def test_pillars_lift_flip_and_relocate_what_they_feel(self):
        # A plain part and the most concave one, of a seed that neither tuning nor the tables use.
        for complexity in (1, 8):
            metrics = self.run_task("arraybot_lift", 8, f"complexity={complexity}", seed=30001)
            self.assertEqual((metrics["success"], metrics["complexity"]), (1, complexity))
            self.assertGreater(metrics["lifted_cm"], 3)
            metrics = self.run_task("arraybot_flip", 10, f"complexity={complexity}", seed=30001)
            self.assertEqual(metrics["success"], 1)
            self.assertGreater(metrics["turned_deg"], 60)
            metrics = self.run_task("arraybot_relocate", 20, f"complexity={complexity}", seed=30001)
            self.assertEqual(metrics["success"], 1)
            self.assertLess(metrics["error_cm"], 2)

    def test_deltas_walk_a_polygon_to_its_pose(self):
        metrics = self.run_task("delta_align", 40)
        self.assertEqual(metrics["success"], 1)
        self.assertLess(metrics["error_u"], 0.3)
        self.assertLess(metrics["angle_error_deg"], 5)

    def test_apple_goes_round_on_a_soft_skin(self):
        metrics = self.run_task("sheet_circle", 12)
        self.assertGreater(metrics["laps"], 0.5)
        self.assertGreaterEqual(metrics["hand_overs"], 2)
        self.assertLess(metrics["error_cm"], 2)

    def test_sheet_floats_to_goal(self):
        metrics = self.run_task("air", 30)
        self.assertLess(metrics["error_u"], 1)
        self.assertGreater(metrics["least_gap_u"], 0.1)

    def test_magnets_attract_one_polarity_and_repel_the_other(self):
        self.assertEqual(self.run_task("magnets", 6)["success"], 1)

    def test_rod_reaches_unique_pose_without_sensors(self):
        for seed in (1, 2):
            self.assertEqual(self.run_task("squeeze", 30, seed=seed)["success"], 1)

    def test_excitable_medium_carries_balls(self):
        metrics = self.run_task("excitable", 15)
        self.assertEqual(metrics["success"], 1)
        self.assertGreater(metrics["speed_u_s"], 2)

    def test_rain_is_shed(self):
        self.assertGreater(self.run_task("rain", 20, "count=100", "n=24")["shed"], 0.9)


if __name__ == "__main__":
    unittest.main()
