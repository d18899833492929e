"""Recordings: replay, drawing and --verify."""
import shutil

import h5py
import numpy

from programs import *

WAVE = str(ROOT / "scripts/examples/wave.lua")


class Replay(ProgramTest):
    def record_wave(self, *flags, until=1):
        recording = str(self.folder / "wave.h5")
        status, _, err = self.run_program(SMARTSURF, "run", WAVE, "--no-controller", "--record",
                                          recording, "--until", str(until), *flags)
        self.assertEqual(status, 0, err)
        return recording

    def verify(self, recording, *flags):
        return self.run_program(SMARTSURF, "replay", recording, "--verify", *flags)

    def test_scripted_run_is_reproduced(self):
        recording = self.record_wave("--set", "amplitude=0.7", "--seed", "5")
        for flags in ([], ["--threads", "2"]):
            status, out, err = self.verify(recording, *flags)
            self.assertEqual((status, err), (0, ""))
            self.assertIn("identical in 61 frames, up to tick 60", out)

    def test_controlled_run_is_reproduced_without_controller(self):
        for mode in ("time-step", "passive"):
            recording = str(self.folder / "sort.h5")
            self.run_sort("--until", "2", "--mode", mode, "--pace", "4", "--record", recording)
            status, out, err = self.verify(recording)
            self.assertEqual((status, err), (0, ""))
            self.assertIn("up to tick 120", out)

    def test_error_names_first_different_tick_and_object(self):
        recording = self.record_wave()
        with h5py.File(recording, "r+") as file:
            for frame in (40, 41):
                file["hash"][frame] = numpy.uint64(1)
                file["objects/position"][frame, 3, 0] += 0.25
        status, out, err = self.verify(recording)
        self.assertEqual((status, out), (1, ""))
        self.assertIn("differs at tick 40: object 3 ('passenger'): position", err)
        self.assertEqual(err.count("\n"), 1)

    def test_changed_experiment_fails(self):
        recording = self.record_wave()
        with h5py.File(recording, "r+") as file:
            text = file["meta"].attrs["experiment"]
            file["meta"].attrs["experiment"] = text.replace("'amplitude', 1.0,", "'amplitude', 1.001,")
        status, _, err = self.verify(recording)
        self.assertEqual(status, 1)
        self.assertRegex(err, "differs at tick [1-9]")

    def test_unrepeatable_recordings_are_refused(self):
        recording = self.record_wave()
        with h5py.File(recording, "r+") as file:
            file["meta"].attrs["unsafe"] = numpy.uint64(1)
        status, _, err = self.verify(recording)
        self.assertEqual(status, 2)
        self.assertIn("--unsafe", err)
        with h5py.File(recording, "r+") as file:
            file["meta"].attrs["touched_by_hand"] = numpy.uint64(7)
        status, _, err = self.verify(recording, "--unsafe")
        self.assertEqual(status, 2)
        self.assertIn("the user intervened after tick 7", err)

    def test_a_signal_at_any_time_leaves_no_folder(self):
        recording, temporary = self.record_wave(until=20), self.folder / "tmp"
        temporary.mkdir()
        for command in (["--verify"], ["--verify", "--unsafe"]):
            child = self.start("/usr/bin/env", f"TMPDIR={temporary}", SMARTSURF, "replay", recording, *command)
            while child.poll() is None and not any(temporary.iterdir()):
                pass
            child.send_signal(signal.SIGTERM)
            status, out, err = self.finish(child)
            self.assertEqual(status, 128 + signal.SIGTERM, out + err)
            self.assertEqual(list(temporary.iterdir()), [])

    def test_a_missing_folder_for_temporary_files_is_named(self):
        status, _, err = self.run_program("/usr/bin/env", "TMPDIR=/nonexist", SMARTSURF, "replay", self.record_wave(), "--verify")
        self.assertEqual((status, err), (2, "smartsurf: TMPDIR = /nonexist: must be a folder: the script's output goes there\n"))

    @needs_view
    def test_replayed_picture_equals_that_of_run(self):
        ours, theirs = self.folder / "run.png", self.folder / "replay.png"
        recording = self.record_wave("--screenshot", f"{ours}@0.5", *SMALL_PICTURE)
        status, _, err = self.run_program(SMARTSURF, "replay", recording, "--screenshot", f"{theirs}@0.5", *SMALL_PICTURE)
        self.assertEqual(status, 0, err)
        self.assertEqual(ours.read_bytes(), theirs.read_bytes())
        status, _, err = self.run_program(SMARTSURF, "replay", recording, "--screenshot", f"{theirs}@5")
        self.assertEqual(status, 2)
        self.assertIn("the recording ends at 1.00 s", err)

    @needs_view
    def test_pictures_between_frames_show_the_latest(self):
        self.write("wave.lua", pathlib.Path(WAVE).read_text() + "\nrecord { every = 30 }\n")
        status, _, err = self.run_program(SMARTSURF, "run", "wave.lua", "--no-controller", "--record", "wave.h5", "--until", "1")
        self.assertEqual(status, 0, err)
        status, _, err = self.run_program(SMARTSURF, "replay", "wave.h5", *SMALL_PICTURE,
                                          *(flag for time in ("0.5", "0.99", "1") for flag in ("--screenshot", f"{time}.png@{time}")))
        self.assertEqual(status, 0, err)
        at, between, after = ((self.folder / f"{time}.png").read_bytes() for time in ("0.5", "0.99", "1"))
        self.assertEqual(at, between)
        self.assertNotEqual(between, after)
        with h5py.File(self.folder / "wave.h5", "r+") as file:
            file["time"][:] += 14
        status, _, err = self.run_program(SMARTSURF, "replay", "wave.h5", "--screenshot", "early.png@1")
        self.assertEqual((status, err), (2, "smartsurf: --screenshot early.png@1: the recording begins at 14.0000 s\n"))

    @needs_view
    def test_view_flags_change_pictures(self):
        recording = self.record_wave()
        pictures = set()
        for flags in ([], ["--wires", "--cells", "height", "--palette", "flame"], ["--camera", "top", "--trails", "1"]):
            picture = self.folder / "look.png"
            status, _, err = self.run_program(SMARTSURF, "replay", recording, "--screenshot", f"{picture}@1", *SMALL_PICTURE, *flags)
            self.assertEqual(status, 0, err)
            pictures.add(picture.read_bytes())
        self.assertEqual(len(pictures), 3)
        status, _, err = self.run_program(SMARTSURF, "replay", recording, "--screenshot", "x.png", "--cells", "heigth")
        self.assertEqual(status, 2)
        self.assertTrue(err.startswith("smartsurf: --cells heigth: no such channel (did you mean 'height'?); known: height"), err)

    @needs_view
    def test_sensors_that_a_recording_lacks_are_sensed_again(self):
        """The paper's Fig. 1, from a recording of the case study without sensors."""
        look = ["--wires", "--cells", "proximity", "--quality", "low", "--picture-size", "320x200"]
        ours, theirs = self.folder / "run.png", self.folder / "replay.png"
        self.run_sort("--until", "2", "--record", "sort.h5", "--screenshot", f"{ours}@1", *look)
        with h5py.File(self.folder / "sort.h5", "r+") as file:
            if "sensors" in file:
                del file["sensors"]
        self.assertIn("none recorded", self.run_program(SMARTSURF, "info", "sort.h5")[1])
        status, _, err = self.run_program(SMARTSURF, "replay", "sort.h5", "--screenshot", f"{theirs}@1", *look)
        self.assertEqual(status, 0, err)
        self.assertIn("sort.h5: has no sensors: running it again", err)
        self.assertEqual(ours.read_bytes(), theirs.read_bytes())
        status, _, err = self.run_program(SMARTSURF, "replay", "sort.h5", "--screenshot", "x.png@1", "--cells", "proximty")
        self.assertEqual(status, 2)
        self.assertIn("--cells proximty: no such channel (did you mean 'proximity'?)", err)
        with h5py.File(self.folder / "sort.h5", "r+") as file:
            file["hash"][3] = numpy.uint64(1)
        status, _, err = self.run_program(SMARTSURF, "replay", "sort.h5", "--screenshot", "x.png@1", *look)
        self.assertEqual(status, 2)
        self.assertIn("sort.h5: cannot be run again: it differs at tick 6", err)
        self.assertFalse((self.folder / "x.png").exists())

    @needs_view
    def test_sensors_named_like_other_channels_are_sensed_again(self):
        self.write("weight.lua", """
            surface { rows = 6, columns = 6, actuator = pin {}, sensors = { pressure { name = 'weight' } } }
            record { sensors = false }
            sphere { radius = 1, position = {2.5, 2.5, 2} }
            """)
        for command in (["run", "weight.lua", "--no-controller", "--until", "0.2", "--record", "weight.h5"],
                        ["replay", "weight.h5", "--screenshot", "x.png", "--cells", "weight", *SMALL_PICTURE]):
            status, _, err = self.run_program(SMARTSURF, *command)
            self.assertEqual(status, 0, err)

    @needs_view
    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_video(self):
        recording = self.record_wave(until=0.2)
        video = self.folder / "wave.mp4"
        status, _, err = self.run_program(SMARTSURF, "replay", recording, "--video", str(video), *SMALL_PICTURE)
        self.assertEqual(status, 0, err)
        self.assertEqual(video.read_bytes()[4:8], b"ftyp")


if __name__ == "__main__":
    unittest.main()
