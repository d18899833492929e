"""The case study of the paper: two processes sort spheres by size."""
import shutil

from programs import *


class Sorting(ProgramTest):
    def check_seed(self, seed, *flags):
        stats = self.run_sort("--until", "120", *flags, seed=seed)
        self.assertRegex(stats["outcome"], r"^stopped by the script: sorted: \d+ % after \d+\.\d s$")
        self.assertGreaterEqual(stats["purity"], 0.95)
        self.assertIsNotNone(stats["sorted_at_s"])
        self.assertLessEqual(stats["sorted_at_s"], 60)
        self.assertGreaterEqual(stats["simulated_s"], stats["sorted_at_s"] + 5.0)
        self.assertEqual(stats["objects"], 40)
        self.assertEqual(stats["off_surface"], 0)

    def test_seed_1(self):
        self.check_seed(1)

    def test_seed_2(self):
        self.check_seed(2)

    def test_dead_and_noisy_sensors_do_no_harm(self):
        self.check_seed(3, "--set", "dead_sensors=0.02", "--set", "dropout=0.01", "--set", "false_hits=0.001")

    def test_tall_spheres_make_room_for_small_ones(self):
        stats = self.run_sort("--until", "120", "--set", "large_radius=5", seed=20104)  # where one stalls among them
        self.assertEqual((stats["success"], stats["left_table"]), (True, 0))

    def test_fast_pins_throw_no_spheres_unless_they_are_not_led(self):
        flags = ["--set", "pin_speed=12", "--set", "pin_acceleration=400", "--set", "small=10", "--set", "large=10"]
        led = self.run_sort("--until", "60", *flags)
        self.assertEqual((led["success"], led["left_table"]), (True, 0))
        self.assertGreater(self.run_sort("--until", "15", "--controller-set", "lead=0", *flags)["left_table"], 2)


class Determinism(ProgramTest):
    def test_runs_are_bit_identical(self):
        flags = ["--ticks", "600"]
        hashes = {self.run_sort(*flags)["state_hash"] for _ in range(2)}
        self.assertEqual(len(hashes), 1)

    def test_threads_and_pace_do_not_affect_results(self):
        hashes = {self.run_sort("--ticks", "300", *flags)["state_hash"]
                  for flags in ([], ["--threads", "2"], ["--pace", "10"])}
        self.assertEqual(len(hashes), 1)

    def test_seed_changes_results(self):
        self.assertNotEqual(self.run_sort("--ticks", "60", seed=1)["state_hash"],
                            self.run_sort("--ticks", "60", seed=2)["state_hash"])

    def test_suspending_either_side_does_not_affect_results(self):
        expected = self.run_sort("--ticks", "900")["state_hash"]
        stats = self.folder / "stats.json"
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--seed", "1", "--shm", self.shm, "--ticks", "900",
                             "--stats", str(stats))
        self.wait_for(self.segment().exists, "the segment")
        controller = self.start(APRON, "run", SORT_APS, "--shm", self.shm)
        for child in (controller, surface, controller):
            time.sleep(0.15)
            if child.poll() is None:
                child.send_signal(signal.SIGSTOP)
                time.sleep(0.4)
                child.send_signal(signal.SIGCONT)
        self.assertEqual(self.finish(surface)[0], 0)
        self.assertEqual(self.finish(controller)[0], 0)
        self.assertEqual(json.loads(stats.read_text())["state_hash"], expected)


class Modes(ProgramTest):
    def test_the_same_program_runs_in_passive_mode(self):
        stats = self.run_sort("--mode", "passive", "--until", "3")
        self.assertEqual(stats["mode"], "passive")
        self.assertEqual(stats["ticks"], 180)
        self.assertLess(stats["actuator_frames_repeated"], 170, "the controller rarely answered")

    def test_the_program_is_purely_local(self):
        status, out, err = self.run_program(APRON, "check", "--local", SORT_APS)
        self.assertEqual(status, 0, err)
        self.assertIn("every instruction is local", out)

    def test_options_change_the_experiment(self):
        stats = self.run_sort("--ticks", "30", "--set", "small=3", "--set", "large=2")
        self.assertEqual(stats["objects"], 5)


class Products(ProgramTest):
    def test_recording_and_figures(self):
        recording = str(self.folder / "sort.h5")
        self.run_sort("--until", "6", "--record", recording, "--record", str(self.folder / "sort.csv"))
        status, out, err = self.run_program(SMARTSURF, "info", recording)
        self.assertEqual(status, 0, err)
        for fact in ("64 rows", "20 'large'", "20 'small'", "seed        1"):
            self.assertIn(fact, out)
        for what in ("trajectories", "purity"):
            for kind, start in (("svg", b"<?xml"), ("pdf", b"%PDF-"), ("png", b"\x89PNG")):
                figures = [self.folder / f"{what}-{i}.{kind}" for i in range(2)]
                for figure in figures:
                    status, _, err = self.run_program(SMARTSURF, "plot", recording, "--what", what, "-o", str(figure))
                    self.assertEqual(status, 0, err)
                self.assertEqual(figures[0].read_bytes(), figures[1].read_bytes())
                self.assertGreater(figures[0].stat().st_size, 2000)
                self.assertTrue(figures[0].read_bytes().startswith(start))
        self.assertIn("tick,time,id,label", (self.folder / "sort.csv").read_text()[:100])

    def test_success_is_that_of_the_experiment(self):
        recording = str(self.folder / "run.h5")
        stats = self.run_sort("--set", "small=1", "--set", "large=1", "--until", "60", "--record", recording)
        self.assertEqual((stats["success"], stats["purity"], stats["metrics"]["purity"]), (True, 1, 1))
        self.assertEqual(stats["sorted_at_s"], stats["success_s"])
        _, out, _ = self.run_program(SMARTSURF, "info", recording)
        self.assertRegex(out, r"metric +purity: [\d.]+ at the start, 1 at the end\nsuccess +at ")
        wave = str(ROOT / "scripts/examples/wave.lua")
        status, _, err = self.run_program(SMARTSURF, "run", wave, "--no-controller", "--ticks", "9", "--record", recording,
                                          "--stats", "wave.json")
        self.assertEqual(status, 0, err)
        stats = json.loads((self.folder / "wave.json").read_text())
        self.assertIsNone(stats["success"])
        self.assertNotIn("purity", stats)
        _, out, _ = self.run_program(SMARTSURF, "info", recording)
        self.assertNotIn("purity", out)
        status, _, err = self.run_program(SMARTSURF, "plot", recording, "--what", "purity", "-o", "x.png")
        self.assertEqual((status, err.count("\n")), (2, 1), err)

    @needs_view
    def test_pictures(self):
        self.run_sort("--until", "1", "--screenshot", str(self.folder / "early.png") + "@0.5",
                      "--screenshot", str(self.folder / "end.png"), *SMALL_PICTURE)
        for picture in ("early.png", "end.png"):
            self.assertEqual((self.folder / picture).read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        self.assertNotEqual((self.folder / "early.png").read_bytes(), (self.folder / "end.png").read_bytes())

    @unittest.skipIf(WITH_VIEW, "built with the view")
    def test_drawing_flags_are_refused_without_the_view(self):
        for flags in (["--window"], ["--screenshot", "end.png"], ["--video", "sort.mp4"]):
            status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--no-controller", *flags)
            self.assertEqual((status, err), (2, "smartsurf: this program was built without the view: configure with "
                                                "-DSMARTSURF_VIEW=ON\n"))

    @needs_view
    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_video(self):
        video = self.folder / "sort.mp4"
        self.run_sort("--until", "0.4", "--video", str(video), *SMALL_PICTURE)
        self.assertEqual(video.read_bytes()[4:8], b"ftyp")
        self.assertFalse(list(self.folder.glob("*.part*")))


if __name__ == "__main__":
    unittest.main()
