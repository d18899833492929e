"""scripts/figures makes every figure, reproducibly, and reports missing programs."""
import shutil
import sys

from programs import *
from programs import PATIENCE, SMALL_PICTURE

FIGURES_SCRIPT = str(ROOT / "scripts/figures")
# Shows each figure with its command.
PAGE = ROOT / "docs/reproducing.md"


def size_of(png):
    head = png.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n", png
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


class Figures(ProgramTest):
    def make(self, out, *flags, environment=None):
        done = subprocess.run([FIGURES_SCRIPT, "--bin", str(BIN), "--out", str(self.folder / out), "--small", *flags],
                              text=True, capture_output=True, env=environment, timeout=PATIENCE)
        return done.returncode, done.stderr

    @unittest.skipUnless(shutil.which("ffmpeg"), "no ffmpeg")
    def test_every_figure_is_made_and_reproducible(self):
        self.assertEqual(self.make("a"), (0, ""))
        made = {p.name: p for p in (self.folder / "a").iterdir()}
        self.assertEqual(sorted(made), ["figure-1.png", "figure-5.png", "figure-6.png", "figure-7.png", "figure-8.png",
                                        "figure-8.svg", "figure-9.png", "figure-9.svg"])
        for n in "1567":  # two 16:10 pictures stacked with a gap
            self.assertEqual(size_of(made[f"figure-{n}.png"]), (320, 2 * 200 + 16))
        self.assertGreater(made["figure-8.svg"].read_text().count("<use"), 200)  # letters are glyphs
        self.assertEqual(self.make("b", "--only", "1,8,9"), (0, ""))
        for name in ("figure-1.png", "figure-8.png", "figure-9.svg"):
            self.assertEqual(made[name].read_bytes(), (self.folder / "b" / name).read_bytes(), name)

    @unittest.skipUnless(shutil.which("ffmpeg"), "no ffmpeg")
    def test_pictures_of_the_pages_are_made(self):
        self.assertEqual(self.make("a", "--images", "--only", "tasks,field,animation"), (0, ""))
        self.assertEqual(size_of(self.folder / "a/tasks.png"), (2 * 166, 2 * 106))
        self.assertEqual((self.folder / "a/sort.webp").read_bytes()[8:16], b"WEBPVP8X")

    def test_errors_report_one_line(self):
        status, err = self.make("a", "--only", "2")
        self.assertEqual(status, 2)
        self.assertIn("--only 2: not among 1, 5, 6, 7, 8, 9", err)
        (self.folder / "bin").mkdir()
        (self.folder / "bin/python3").symlink_to(sys.executable)
        (self.folder / "bin/env").symlink_to(shutil.which("env"))
        status, err = self.make("a", "--only", "1", environment={**os.environ, "PATH": str(self.folder / "bin")})
        self.assertEqual(status, 1)
        self.assertIn("ffmpeg is not installed", err)
        self.assertEqual(list((self.folder / "a").iterdir()), [])

    def test_pictures_have_requested_size(self):
        wave = [SMARTSURF, "run", str(ROOT / "scripts/examples/wave.lua"), "--no-controller", "--ticks", "2"]
        self.assertEqual(self.run_program(*wave, "--screenshot", "a.png", "--picture-size", "123x45")[0], 0)
        self.assertEqual(size_of(self.folder / "a.png"), (123, 45))
        for size, flag, file in (("123", "--screenshot", "b.png"), ("123x45x", "--screenshot", "b.png"),
                                 ("8x45", "--screenshot", "b.png"), ("99999x45", "--screenshot", "b.png"),
                                 ("123x45", "--video", "b.mp4")):
            status, _, err = self.run_program(*wave, flag, file, "--picture-size", size)
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertIn(f"--picture-size {size}", err)
            self.assertFalse((self.folder / file).exists())

    def test_pictures_are_drawn_silently_where_a_folder_for_caches_is_set(self):
        (self.folder / "cache").mkdir()
        status, _, err = self.run_program("env", f"XDG_CACHE_HOME={self.folder / 'cache'}", SMARTSURF, "run",
                                          str(ROOT / "scripts/examples/wave.lua"), "--no-controller", "--ticks", "2", "--screenshot",
                                          "a.png", *SMALL_PICTURE)
        self.assertEqual((status, err.count("\n")), (0, 1), err)

    def test_traced_pictures_and_videos(self):
        wave = [SMARTSURF, "run", str(ROOT / "scripts/examples/wave.lua"), "--no-controller", "--ticks", "2"]
        final = ["--quality", "final", "--samples", "2", "--aperture", "2", "--picture-size", "124x46"]
        kinds = {"png": "--screenshot", "mp4": "--video"} if shutil.which("ffmpeg") else {"png": "--screenshot"}
        for name in ("a", "b"):
            outputs = [word for kind, flag in kinds.items() for word in (flag, f"{name}.{kind}")]
            status, _, err = self.run_program(*wave, *final, "--cells", "height", "--trails", "1", *outputs)
            if "built without Embree" in err:
                self.assertEqual((status, err.count("\n")), (2, 1), err)
                self.skipTest("built without Embree")
            self.assertEqual(status, 0, err)
        self.assertEqual(size_of(self.folder / "a.png"), (124, 46))
        for kind in kinds:
            self.assertEqual((self.folder / f"a.{kind}").read_bytes(), (self.folder / f"b.{kind}").read_bytes())
        for flags, words in ((["--aperture", "2"], "need --quality final"), (["--samples", "8"], "need --quality final"),
                             ([*final, "--wires"], "--wires: not with --quality final"), (["--quality", "final", "--samples", "0"], "--samples")):
            status, _, err = self.run_program(*wave, *flags, "--screenshot", "c.png")
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertIn(words, err)
            self.assertFalse((self.folder / "c.png").exists())

    def test_page_names_every_figure_and_pictures_exist(self):
        page = PAGE.read_text()
        for n in "156789":
            self.assertIn(f"scripts/figures --only {n}", page)
        for name in ("hero.webp", "windows.webp", "sort.webp", "apron-window.png", "apron-window-narrow.png"):
            self.assertTrue((ROOT / "docs/images" / name).stat().st_size < 3_000_000, name)


if __name__ == "__main__":
    unittest.main()
