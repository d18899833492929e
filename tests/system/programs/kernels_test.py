"""Each kernel of scripts/scamp5 equals its NumPy reference to the bit without errors, and its figures are those of
docs/scamp5-kernels.md."""
import re

import numpy as np

from programs import *

KERNELS = ROOT / "scripts/scamp5"
SHIFTS = {"north": (1, 0), "south": (-1, 0), "west": (0, 1), "east": (0, -1)}
SIZE = 32


def saturate(a):
    return np.clip(a, -128, 127)


def neighbour(a, *directions):
    """The value of that neighbour in every cell; 0 beyond the edge."""
    for direction in directions:
        dy, dx = SHIFTS[direction]
        padded = np.pad(a, 1)
        a = padded[1 - dy:padded.shape[0] - 1 - dy, 1 - dx:padded.shape[1] - 1 - dx]
    return a


def write_error(value):
    """The standard deviation of a write of that value over the cells: noise, offset and gain, as docs/scamp5.md says."""
    return np.sqrt(0.3**2 + 0.3**2 + (0.005 * value)**2)


def sobel(image):
    rows = saturate(saturate(saturate(neighbour(image, "north") + neighbour(image, "south")) + image) + image)
    return saturate(abs(saturate(neighbour(rows, "east") - neighbour(rows, "west"))))


def contrast(image, direction):
    return saturate(abs(saturate(neighbour(image, direction) - image)))


def edges(image, threshold=20):
    return (contrast(image, "east") > threshold) | (contrast(image, "south") > threshold)


def gauss(image):
    for first, second in (("north", "south"), ("west", "east")):
        half = image / 2
        image = half + (neighbour(half, first) + neighbour(half, second)) / 2
    return image


# The steps of a turn and a half of the circle, from three cells north of the centre.
EAST = [("east",), ("east", "south"), ("east", "south"), ("south",), ("south",), ("south", "west"), ("south", "west"), ("west",)]
WEST = [("west",), ("west", "north"), ("west", "north"), ("north",), ("north",), ("north", "east"), ("north", "east"), ("east",)]


def fast16(image, threshold=20, run=9):
    """Contiguous cells of the circle, as the definition says."""
    corner = np.zeros(image.shape, bool)
    circle = [neighbour(image, "north", "north", "north")]
    for step in EAST + WEST[:-1]:
        circle.append(neighbour(circle[-1], *step))
    for sign in (1, -1):
        beyond = [saturate(sign * (cell - image)) > threshold for cell in circle]
        for first in range(16):
            corner |= np.logical_and.reduce([beyond[(first + k) % 16] for k in range(run)])
    return corner


def census(image):
    order = [("north",), ("north", "east"), ("east",), ("south", "east"), ("south",), ("south", "west"), ("west",),
             ("north", "west")]
    return sum((neighbour(image, *one) > image) * 2**k for k, one in enumerate(order))


def localise(image, threshold=-20):
    """The cells that a flood from the edge does not reach, and their north-western corners."""
    outline = image < threshold
    wet = np.zeros(image.shape, bool)
    while True:
        spread = np.pad(wet, 1, constant_values=True)
        grown = (spread[:-2, 1:-1] | spread[2:, 1:-1] | spread[1:-1, :-2] | spread[1:-1, 2:] | wet) & ~outline
        if (grown == wet).all():
            break
        wet = grown
    inside = ~wet & ~outline
    events = inside & ~neighbour(inside, "north") & ~neighbour(inside, "west")
    return inside, [(x, y) for y, x in np.argwhere(events)]


def ternary(image, weights):
    image = image / 8
    order = [("north", "west"), ("north",), ("north", "east"), ("west",), (), ("east",), ("south", "west"), ("south",),
             ("south", "east")]
    layer = np.zeros(image.shape)
    for weight, one in zip(weights, order):
        layer = saturate(layer + weight * neighbour(image, *one))
    layer = np.maximum(layer, 0)
    layer = np.maximum(layer, neighbour(layer, "east"))
    return np.maximum(layer, neighbour(layer, "south"))


# Kernels in the style of the chip's tutorials. A run of cells is counted in steps of 12, which noise does not hide.
SOBEL_CPP = """\
#include <scamp5.hpp>
using namespace SCAMP5_PE;

// Slope of the columns.
int main() {
  vs_init();
  while (1) {
    vs_frame_loop_control();
    scamp5_kernel_begin();
      get_image(C, D);
      movx(A, C, north);
      movx(B, C, south);
      add(A, A, B);
      add(A, A, C);
      add(A, A, C);
      movx(B, A, east);
      movx(A, A, west);
      sub(B, B, A);
      abs(D, B);
    scamp5_kernel_end();
    scamp5_output_image(D, display_1);
  }
}
"""
FAST_CPP = """\
#include <scamp5.hpp>
using namespace SCAMP5_PE;

int threshold = 20;
int dark = 0;

void compare() {
  if (dark == 0) {
    scamp5_kernel_begin();
      sub(D, B, A);
    scamp5_kernel_end();
  } else {
    scamp5_kernel_begin();
      sub(D, A, B);
    scamp5_kernel_end();
  }
  scamp5_kernel_begin();
    sub(D, D, F);
    where(D);
      MOV(R5, FLAG);
    all();
    NOT(R6, R5);
    WHERE(R6);
      res(C);
    WHERE(R5);
      add(C, C, E);
    all();
  scamp5_kernel_end();
  scamp5_in(D, -102);  // 8.5 units: nine in a row
  scamp5_kernel_begin();
    add(D, D, C);
    where(D);
      MOV(R7, FLAG);
    all();
    OR(R8, R8, R7);
  scamp5_kernel_end();
}

#define STEP(dir) { scamp5_kernel_begin(); movx(B, B, dir); scamp5_kernel_end(); compare(); }
#define DIAGONAL(dir, other) { scamp5_kernel_begin(); mov2x(B, B, dir, other); scamp5_kernel_end(); compare(); }

void eastern_half() {
  STEP(east);
  for (int i = 0; i < 2; i++) DIAGONAL(east, south);
  for (int i = 0; i < 2; i++) STEP(south);
  for (int i = 0; i < 2; i++) DIAGONAL(south, west);
  STEP(west);
}

void western_half() {
  STEP(west);
  for (int i = 0; i < 2; i++) DIAGONAL(west, north);
  for (int i = 0; i < 2; i++) STEP(north);
  for (int i = 0; i < 2; i++) DIAGONAL(north, east);
  STEP(east);
}

int main() {
  vs_init();
  vs_gui_add_slider("threshold", 0, 127, 20, &threshold);
  while (1) {
    vs_frame_loop_control();
    scamp5_get_image(A, B, 1);
    scamp5_in(E, 12);
    scamp5_in(F, threshold);
    scamp5_kernel_begin();
      CLR(R8);
    scamp5_kernel_end();
    for (dark = 0; dark < 2; dark++) {
      scamp5_kernel_begin();
        res(C);
        mov2x(B, A, north, north);
        movx(B, B, north);
      scamp5_kernel_end();
      compare();
      eastern_half();
      western_half();
      eastern_half();
    }
    scamp5_output_image(R8, display);
  }
}
"""


class Kernels(ProgramTest):
    def setUp(self):
        super().setUp()
        self.random = np.random.default_rng(7)

    def frames(self, *images):
        """Writes the images, -128 to 127, as the light of consecutive frames."""
        folder = self.folder / f"frames-{time.monotonic_ns()}"
        folder.mkdir()
        for k, image in enumerate(images):
            height, width = image.shape
            (folder / f"{k:03}.pgm").write_text(f"P2 {width} {height} 255 " + " ".join(str(int(v + 128)) for v in image.flat))
        return folder

    def kernel(self, name, images, *registers, flags=()):
        """Runs a kernel on the frames; returns its output and registers after the last one."""
        files = [self.folder / f"{register.strip('[]')}.npy" for register in registers]
        height, width = images[0].shape
        words = [word for register, file in zip(registers, files) for word in ("--save", f"{register}={file}")]
        status, out, err = self.finish(self.start(
            APRON, "run", str(KERNELS / f"{name}.aps"), "--size", f"{width}x{height}", "--camera", str(self.frames(*images)),
            "--ticks", str(len(images)), *words, *flags))
        self.assertEqual((status, err), (0, ""), name)
        return out, *(np.load(file) for file in files)

    def noise(self, low=-128, high=127):
        return self.random.integers(low, high, (SIZE, SIZE), endpoint=True)

    def scene(self):
        """Rectangles on a slope, with a little noise."""
        image = np.add.outer(np.arange(SIZE), np.arange(SIZE)) // 2 - 60 + self.noise(-4, 4)
        for _ in range(5):
            x, y = self.random.integers(2, SIZE - 12, 2)
            image[y:y + 8, x:x + 9] += self.random.integers(-60, 60)
        return saturate(image)

    def assert_equals(self, got, wanted):
        np.testing.assert_array_equal(got, np.asarray(wanted, dtype=np.float64))

    def test_single_image_kernels(self):
        for name, reference in (("sobel", sobel), ("edges", edges), ("gauss", gauss), ("census", census)):
            for image in (self.noise(), self.scene()):
                self.assert_equals(self.kernel(name, [image], "Result")[1], reference(image))

    def test_fast16(self):
        found = 0
        inner = slice(6, SIZE - 6)  # where the walk along the circle never leaves the array
        for image in (self.noise(), self.scene(), self.scene()):
            wanted = fast16(image)[inner, inner]
            self.assert_equals(self.kernel("fast16", [image], "Result")[1][inner, inner], wanted)
            found += wanted.sum()
        self.assertGreater(found, 10)

    def test_odometry(self):
        world = self.random.integers(-100, 100, (SIZE + 40, SIZE + 40))
        world = (world + np.roll(world, 1, 0) + np.roll(world, 1, 1)) // 3
        path = [(0, 0), (1, 0), (1, 0), (0, 1), (0, 0), (-1, 0), (0, -1), (0, -1)]
        x, y, images, wanted = 20, 20, [], ""
        for dx, dy in path:
            x, y = x - dx, y - dy  # the scene moves against the window
            images.append(world[y:y + SIZE, x:x + SIZE])
            wanted += f"{20 - x} {20 - y}\n"
        self.assertEqual(self.kernel("odometry", images)[0], wanted)

    def test_localise(self):
        image = np.full((SIZE, SIZE), 40)
        for x, y, size in ((3, 4, 6), (15, 8, 9), (8, 20, 5)):
            image[y:y + size, x:x + size] = -80
            image[y + 1:y + size - 1, x + 1:x + size - 1] = 30
        image[26, 15:30] = -80  # a line is no outline
        image[12, 15] = 40  # a gap lets the flood in
        wanted, events = localise(image)
        self.assertEqual(events, [(4, 5), (9, 21)])
        text = (KERNELS / "localise.aps").read_text()
        got = self.kernel("localise", [image], "Result")[1]
        self.assert_equals(got, wanted)
        program = self.write("events.aps", text.replace("sim.frame\n", "println(r[Events])\nsim.frame\n"))
        _, out, _ = self.finish(self.start(APRON, "run", program, "--size", f"{SIZE}x{SIZE}", "--camera",
                                           str(self.frames(image)), "--ticks", "1"))
        self.assertEqual(out.splitlines()[:3], ["4 5", "9 21", "-1 -1"])

    def test_ternary(self):
        for image in (self.noise(), self.scene()):
            _, vertical, corner = self.kernel("ternary", [image], "Vertical", "Corner")
            self.assert_equals(vertical, ternary(image, [-1, 0, 1] * 3))
            self.assert_equals(corner, ternary(image, [1, 1, 0, 1, -1, -1, 0, -1, 0]))

    def test_sigma_delta(self):
        images = [self.noise(-10, 10) for _ in range(12)]
        for k, image in enumerate(images):
            image[5:12, 2 + k:8 + k] = 90
        background = images[0].astype(float)
        for image in images:
            background += image > background
            background -= background > image
        _, got, model = self.kernel("sigma-delta", images, "Result", "Background")
        self.assert_equals(model, background)
        self.assert_equals(got, abs(images[-1] - background) > 20)
        self.assertGreater(got.sum(), 20)

    def test_depth_from_focus(self):
        images = [self.noise(-60, 60) // (1 + abs(k - 3)) for k in range(6)]
        best, index = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
        for k, image in enumerate(images):
            quarter = image / 4
            sharpness = saturate(sum(neighbour(quarter, one) for one in SHIFTS) - image)
            sharpness = saturate(abs(sharpness))
            index[sharpness > best] = k
            best = np.maximum(best, sharpness)
        self.assert_equals(self.kernel("depth-from-focus", images, "Result")[1], index)

    def imported(self, source, image, register, *directives):
        """The register after `apron import` of the kernel has run on the image, and what was left out."""
        kernel, program = self.write("kernel.cpp", source), self.folder / "imported.aps"
        picture, file = self.frames(image) / "000.pgm", self.folder / "imported.npy"
        status, _, left_out = self.finish(self.start(APRON, "import", kernel, "--picture", str(picture), "--output", str(program)))
        self.assertEqual(status, 0, left_out)
        head = "!include('scamp5.aps')\n"
        program.write_text(program.read_text().replace(head, head + "".join(line + "\n" for line in directives)))
        status, _, err = self.finish(self.start(APRON, "run", str(program), "--size", f"{SIZE}x{SIZE}", "--save",
                                                f"{register}={file}"))
        self.assertEqual((status, err), (0, ""))
        return np.load(file), left_out

    def test_imported_sobel(self):
        for image in (self.noise(), self.scene()):
            got, left_out = self.imported(SOBEL_CPP, image, "D")
            self.assert_equals(got, sobel(image))
            self.assertEqual(re.findall(r"'(\w+)' runs on", left_out), ["vs_init", "vs_frame_loop_control"])

    def test_imported_sobel_with_errors(self):
        """Each transfer adds its error, times its weight in the result: the standard deviation is that of their sum."""
        image = self.scene() // 4
        got, _ = self.imported(SOBEL_CPP, image, "D", "scamp5.errors(on)")
        ideal = sobel(image)
        # The image, of three transfers, enters with Sobel's weights; a row's sum of ten on both sides; two moves, the
        # difference and the absolute value have two each.
        weights = np.sqrt(3 * 12 + 2 * (5 * 2 + 4))
        error = got - ideal
        self.assertGreater(error.std(), 0.5 * write_error(0) * weights)
        self.assertLess(error.std(), write_error(4 * abs(image).max()) * weights + 0.004 * 8 * ideal.max())

    def test_imported_fast(self):
        found, inner = 0, slice(6, SIZE - 6)  # where the walk along the circle never leaves the array
        for image in (self.noise(), self.scene()):
            got, _ = self.imported(FAST_CPP, image, "R8")
            wanted = fast16(image)[inner, inner]
            self.assert_equals(got[inner, inner], wanted)
            found += wanted.sum()
        self.assertGreater(found, 10)

    def test_imported_fast_with_errors(self):
        """Only corners whose contrast is within the error of a walk of 24 moves of two transfers, or whose run is within that
        of nine steps, may change."""
        image = self.noise(-1, 1) - 40
        for x, y in ((7, 8), (18, 9), (12, 20)):
            image[y:y + 6, x:x + 7] += 80
        inner, transfers, largest = slice(6, SIZE - 6), 2 * 24, abs(image).max()
        got = self.imported(FAST_CPP, image, "R8", "scamp5.errors(on)")[0][inner, inner] != 0
        margin = 0.004 * transfers * largest + 3 * write_error(largest) * np.sqrt(transfers)
        runs = 4 * write_error(12) * np.sqrt(2) * 9 / 12  # the step's own error counts nine times
        surest, possible = (fast16(image, 20 + sign * margin, 9 + sign * round(runs))[inner, inner] for sign in (1, -1))
        self.assertTrue((got >= surest).all())
        self.assertTrue((got <= possible).all())
        self.assertGreater(surest.sum(), 8)
        self.assertLess(possible.mean(), 0.5)

    def test_errors_stay_near_the_ideal_result(self):
        """With the chip's errors the Gaussian is off by little, and not by nothing."""
        image = self.scene()
        program = self.write("noisy.aps", (KERNELS / "gauss.aps").read_text().replace("#frame\n", "scamp5.errors(on)\n#frame\n"))
        file = self.folder / "noisy.npy"
        status, _, err = self.finish(self.start(APRON, "run", program, "--size", f"{SIZE}x{SIZE}", "--camera",
                                                str(self.frames(image)), "--ticks", "1", "--save", f"Result={file}"))
        self.assertEqual(status, 0, err)
        error = np.load(file) - gauss(image)
        self.assertGreater(error.std(), 0.1)
        self.assertLess(error.std(), 5)

    def test_page_states_cycles_and_frame_rates(self):
        page = (ROOT / "docs/scamp5-kernels.md").read_text()
        rows = dict(re.findall(r"^\| `([\w-]+)\.aps` \|[^|]*\|( [\d,]+ \| [\d,]+) \|", page, re.MULTILINE))
        names = {file.stem for file in KERNELS.glob("*.aps")}
        self.assertEqual(set(rows), names)
        profile = self.folder / "profile.json"
        for name in sorted(names):
            self.kernel(name, [self.noise()] * 2, flags=("--profile", str(profile), "--cost-model", "scamp5.json"))
            cycles, rate = measured(json.loads(profile.read_text()))
            self.assertEqual(rows[name], f" {cycles:,} | {rate:,}", name)


def measured(profile):
    """Cycles of a frame, and frames a second at the chip's clock without exposure and read-out."""
    frame = profile["estimate"]["per_frame"]
    return round(frame["cycles"]), round(1 / frame["time_s"])


if __name__ == "__main__":
    unittest.main()
