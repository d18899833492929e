"""Each program of scripts/apron-examples computes what a plain reference in this file computes."""
import collections
import csv
import heapq
import math

from programs import *

EXAMPLES = ROOT / "scripts/apron-examples"


class ShippedPrograms(ProgramTest):
    def test_are_formatted(self):
        programs = sorted(str(path) for path in (ROOT / "scripts").rglob("*.aps"))
        self.assertGreater(len(programs), 60)
        self.assertEqual(self.run_program(APRON, "fmt", "--check", *programs)[:2], (0, ""))

    def test_no_routine_of_the_library_fails_in_every_call(self):
        files = sorted((ROOT / "scripts/apron").glob("*.aps"))
        self.assertGreater(len(files), 8)
        for file in files:
            status, _, err = self.run_program(APRON, "check", str(file), "--size", "16x16")
            self.assertEqual((status, err), (0, ""), file.name)


class ApronExamples(ProgramTest):
    def example(self, name, registers, *flags, ticks=100000, size="32x32"):
        """Runs a program; returns its output and the registers as lists of rows, from the north."""
        files = {register: self.folder / f"{name}-{register}.csv" for register in registers}
        saves = [word for register, file in files.items() for word in ("--save", f"{register}={file}")]
        status, out, err = self.finish(self.start(APRON, "run", str(EXAMPLES / f"{name}.aps"), "--size", size,
                                                  "--ticks", str(ticks), *saves, *flags))
        self.assertEqual((status, err), (0, ""), name)
        return out, *([[float(cell) for cell in row] for row in csv.reader(file.read_text().splitlines())]
                      for file in files.values())

    def assert_close(self, got, wanted, tolerance):
        for y, (got_row, wanted_row) in enumerate(zip(got, wanted, strict=True)):
            for x, (a, b) in enumerate(zip(got_row, wanted_row, strict=True)):
                self.assertLessEqual(abs(a - b), tolerance, f"cell {x}, {y}: {a}, not {b}")

    def test_every_example_is_tested_and_shown(self):
        names = {file.stem for file in EXAMPLES.glob("*.aps")}
        tested = {name.removeprefix("test_").replace("_", "-") for name in dir(self) if name.startswith("test_")}
        self.assertLessEqual(names, tested)
        page = (ROOT / "docs/apron-examples.md").read_text()
        for name in names:
            self.assertIn(f"{name}.aps", page)

    def test_life(self):
        for born, survive in (("3", "23"), ("36", "125")):
            rule = ("--set", f"born={born}", "--set", f"survive={survive}")
            _, life = self.example("life", ["Life"], *rule, ticks=1)
            for _ in range(20):
                n = len(life)
                count = [[sum(life[(y + dy) % n][(x + dx) % n] for dy in (-1, 0, 1) for dx in (-1, 0, 1)) - life[y][x]
                          for x in range(n)] for y in range(n)]
                life = [[float(str(int(count[y][x])) in (survive if life[y][x] else born)) for x in range(n)] for y in range(n)]
            self.assertEqual(self.example("life", ["Life"], *rule, ticks=21)[1], life)

    def test_neural_automaton(self):
        n = 14
        weights = self.folder / "weights.aps"
        weights.write_text("random.seed(4)\nfor(i, 0, 1535)\nw = random.float.gauss(0, 0.2)\nprintln(w)\nendfor\n"
                           "for(i, 0, 511)\nw = random.float.gauss(0, 0.1)\nprintln(w)\nendfor\n")
        status, out, err = self.finish(self.start(APRON, "run", str(weights)))
        self.assertEqual((status, err), (0, ""))
        weight = [float(line) for line in out.split()]
        channels = [f"s[{c}]" for c in range(16)]
        _, *before = self.example("neural-automaton", channels, ticks=6, size=f"{n}x{n}")
        _, *after = self.example("neural-automaton", channels, ticks=7, size=f"{n}x{n}")

        def at(plane, x, y):
            return plane[y][x] if 0 <= x < n and 0 <= y < n else 0.0

        fired = 0
        for y in range(n):
            for x in range(n):
                old, new = [plane[y][x] for plane in before], [plane[y][x] for plane in after]
                if max(at(before[3], x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)) <= 0.1:
                    self.assertEqual(new, [0.0] * 16)
                    continue
                perceived = []
                for s in before:
                    near = [[at(s, x + i, y + j) for i in (-1, 0, 1)] for j in (-1, 0, 1)]
                    slope = [sum(k * (row[2] - row[0]) for k, row in zip((1, 2, 1), near)) / 8,
                             sum(k * (below - above) for k, below, above in zip((1, 2, 1), near[2], near[0])) / 8]
                    perceived += [s[y][x], *slope]
                hidden = [max(sum(weight[48 * k + j] * p for j, p in enumerate(perceived)), 0) for k in range(32)]
                update = [min(max(s + sum(weight[1536 + 32 * c + k] * h for k, h in enumerate(hidden)), -1), 1)
                          for c, s in enumerate(old)]
                rests = all(abs(a - b) < 1e-5 for a, b in zip(new, old))
                fires = all(abs(a - b) < 1e-5 for a, b in zip(new, update))
                self.assertTrue(rests or fires, f"cell {x}, {y}: {new}, not {update}")
                fired += fires and not rests
        self.assertGreater(fired, 5)

    def test_gray_scott(self):
        _, u, v = self.example("gray-scott", ["U", "V"], ticks=1, size="24x24")
        n, feed, kill = 24, 0.037, 0.06

        def laplacian(a):
            return [[a[y - 1][x] + a[(y + 1) % n][x] + a[y][x - 1] + a[y][(x + 1) % n] - 4 * a[y][x] for x in range(n)]
                    for y in range(n)]

        for _ in range(8 * 5):
            flow_u, flow_v = laplacian(u), laplacian(v)
            for y in range(n):
                for x in range(n):
                    reaction = u[y][x] * v[y][x] ** 2
                    u[y][x] += 0.16 * flow_u[y][x] - reaction + feed * (1 - u[y][x])
                    v[y][x] += 0.08 * flow_v[y][x] + reaction - (feed + kill) * v[y][x]
        _, got_u, got_v = self.example("gray-scott", ["U", "V"], ticks=6, size="24x24")
        self.assert_close(got_u, u, 1e-4)
        self.assert_close(got_v, v, 1e-4)
        self.assertGreater(max(map(max, v)), 0.1)  # the pattern lives

    def test_label(self):
        out, blobs, label = self.example("label", ["Blobs", "Label"], size="48x48")
        height, width = len(blobs), len(blobs[0])
        wanted = [[0.0] * width for _ in range(height)]
        components = 0
        for y in reversed(range(height)):
            for x in reversed(range(width)):  # from the largest number down
                if not blobs[y][x] or wanted[y][x]:
                    continue
                components += 1
                work = [(x, y)]
                while work:
                    i, j = work.pop()
                    if 0 <= i < width and 0 <= j < height and blobs[j][i] and not wanted[j][i]:
                        wanted[j][i] = 1.0 + x + width * y
                        work += [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
        self.assertEqual(label, wanted)
        self.assertGreater(components, 3)
        self.assertEqual(out, f"components {components}\n")

    def test_chamfer(self):
        out, obstacle, distance = self.example("chamfer", ["Obstacle", "Distance"])
        n = len(obstacle)
        wanted = [[math.inf] * n for _ in range(n)]
        queue = [(0.0, x, y) for y in range(n) for x in range(n) if obstacle[y][x]]
        while queue:
            d, x, y = heapq.heappop(queue)
            if d >= wanted[y][x]:
                continue
            wanted[y][x] = d
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    if 0 <= x + dx < n and 0 <= y + dy < n and (dx or dy):
                        heapq.heappush(queue, (d + (4 if dx and dy else 3), x + dx, y + dy))
        self.assertEqual(distance, wanted)
        self.assertEqual(out, f"largest {int(max(map(max, wanted)))}\n")

    def test_lucas_kanade(self):
        for east, south in ((0.6, -0.3), (-0.4, 0.5)):
            flags = ("--set", f"east={east}", "--set", f"south={south}")
            _, got_east, got_south = self.example("lucas-kanade", ["East", "South"], *flags, ticks=4, size="48x48")
            for got, wanted in ((got_east, east), (got_south, south)):
                inner = [cell for row in got[10:38] for cell in row[10:38]]
                self.assertLess(max(abs(cell - wanted) for cell in inner), 0.15)
                self.assertAlmostEqual(sum(inner) / len(inner), wanted, delta=0.05)

    def test_lucas_kanade_takes_pictures_of_a_folder(self):
        """A pattern that steps one column to the east from picture to picture."""
        folder = self.folder / "frames"
        folder.mkdir()
        for k in range(3):
            cells = [round(128 + 50 * math.sin(0.5 * (x - k)) + 50 * math.sin(0.4 * y)) for y in range(32) for x in range(32)]
            (folder / f"{k}.pgm").write_text(f"P2 32 32 255 {' '.join(map(str, cells))}")
        _, east = self.example("lucas-kanade", ["East"], "--set", "camera=1", "--camera", str(folder), ticks=1)
        inner = [cell for row in east[8:24] for cell in row[8:24]]
        self.assertAlmostEqual(sum(inner) / len(inner), 1.0, delta=0.1)

    def test_wavefront(self):
        out, wall, path = self.example("wavefront", ["Wall", "Path"])
        n = len(wall)
        steps = {(n - 1, n - 1): 0}
        work = collections.deque(steps)
        while work:
            x, y = work.popleft()
            for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
                if cell not in steps and 0 <= cell[0] < n and 0 <= cell[1] < n and not wall[cell[1]][cell[0]]:
                    steps[cell] = steps[x, y] + 1
                    work.append(cell)
        self.assertEqual(out, f"steps {steps[0, 0]}\n")
        # One free cell of every distance, each beside the one before it.
        cells = sorted(((x, y) for y in range(n) for x in range(n) if path[y][x]), key=lambda cell: steps[cell])
        self.assertEqual([steps[cell] for cell in cells], list(range(steps[0, 0] + 1)))
        for (x, y), (i, j) in zip(cells, cells[1:]):
            self.assertEqual(abs(x - i) + abs(y - j), 1)

    def test_kmeans(self):
        out, image, result = self.example("kmeans", ["Image", "Result"])
        levels = [float(word) for word in out.split()]
        self.assertEqual(len(levels), 4)
        members = collections.defaultdict(list)
        for grey, level in zip(sum(image, []), sum(result, []), strict=True):
            nearest = min(levels, key=lambda one: abs(one - grey))
            self.assertAlmostEqual(level, nearest, delta=1e-3)
            members[nearest].append(grey)
        for level in levels:
            self.assertAlmostEqual(sum(members[level]) / len(members[level]), level, delta=1e-3)

    def test_bitonic(self):
        _, last = self.example("bitonic", ["Values"])
        _, first = self.example("bitonic", ["Values"], ticks=1)
        self.assertEqual(last, [sorted(row) for row in first])

    def test_snake(self):
        size = 20, 16
        steer = lambda *keys, ticks=1: self.example("snake", ["Food", "Body"], *(w for key in keys for w in ("--keys", key)),
                                                    size="20x16", ticks=ticks)
        _, food, body = steer()
        fx, fy = next((x, y) for y, row in enumerate(food) for x, cell in enumerate(row) if cell)
        x, y = next((x, y) for y, row in enumerate(body) for x, cell in enumerate(row) if cell == 3)
        self.assertEqual((x, y), (11, 8))
        # First into the food's row, then into its column; from the west, because it begins towards the east.
        rows, columns = abs(fy - y), abs(fx - x)
        self.assertTrue(rows and columns)
        turns = ("down" if fy > y else "up") + "@1", ("right" if fx > x else "left") + f"@{rows + 1}"
        out, food, body = steer(*turns, ticks=rows + columns + 1)
        self.assertEqual(body[fy][fx], 4)
        self.assertEqual(sum(cell > 0 for row in body for cell in row), 4)
        self.assertEqual(sum(map(sum, food)), 1)
        self.assertEqual(food[fy][fx], 0)
        # It leaves the array in the end.
        self.assertEqual(steer(*turns, ticks=1000)[0], "length 4\n")
        self.assertEqual(steer(ticks=1000)[0], "length 3\n")


if __name__ == "__main__":
    unittest.main()
