"""The numbers and the plots of the exported page: its script, run by Node."""
import random
import shutil

from programs import *

NODE = shutil.which("node")

LOAD = f"const folder = {json.dumps(str(ROOT / 'smartsurf/web'))};" + """
import fs from 'node:fs';
for (const [name, file] of [['three', 'three/three.min.js'], ['mechanisms', 'mechanisms.js'], ['table', 'table.js'], ['plots', 'plots.js']])
  fs.writeFileSync(name + '.mjs', fs.readFileSync(`${folder}/${file}`, 'utf8')
    .replace(/from '(three|mechanisms|table)'/g, "from './$1.mjs'"));
const load = (name) => import(process.cwd() + '/' + name + '.mjs');
const given = JSON.parse(fs.readFileSync('given.json', 'utf8'));
const done = (made) => fs.writeFileSync('made.json', JSON.stringify(made));
"""
TEXTS = LOAD + """
const { numberText } = await load('table');
done(given.map(([value, range]) => numberText(value ?? NaN, range)));
"""
PIECES = LOAD + """
const { visiblePieces } = await load('plots');
done(given.map(([values, size]) => visiblePieces(values.map((v) => v ?? NaN), (f) => Math.floor(f / size))));
"""
# What a plot draws: the calls of its pens, on canvases of 200 × 80, in each of some frames.
DRAWING = LOAD + """
const calls = [];
const element = () => {
  const pen = { fillText: (...all) => calls.push(['text', ...all]), lineTo: () => calls.push(['line']),
    measureText: (text) => ({ width: 6 * text.length }),
    moveTo() {}, beginPath() {}, stroke() {}, fillRect() {}, clearRect() {}, drawImage() {}, strokeRect: (x) => calls.push(['cursor', x]) };
  return { clientWidth: 200, clientHeight: 80, getContext: () => pen, append() {}, addEventListener() {} };
};
globalThis.document = { createElement: element, getElementById: element };
globalThis.window = { devicePixelRatio: 1 };
globalThis.getComputedStyle = () => ({ getPropertyValue: () => '' });
const { makePlots } = await load('plots');
const { values } = given, state = { dark: false };
const plots = makePlots({ time: values.map((_, f) => f / 60) }, state, () => {});
plots.add('one', (f) => values[f]);
done([0, 1, 7].map((frame) => { calls.length = 0; plots.draw(frame); return [...calls]; }));
"""


NAMES = LOAD + """
const three = await load('three'), source = ['table', 'mechanisms'].map((name) => fs.readFileSync(name + '.mjs', 'utf8')).join('');
done(Object.fromEntries([...source.matchAll(/THREE\\.(\\w+)/g)].map(([, name]) => [name, name in three])));
"""


@unittest.skipUnless(NODE, "node is not installed")
class PagePlots(ProgramTest):
    def made(self, script, given):
        self.write("given.json", json.dumps(given))
        self.write("play.mjs", script)
        status, _, err = self.run_program(NODE, "play.mjs")
        self.assertEqual(status, 0, err)
        return json.loads((self.folder / "made.json").read_text())

    def test_the_bundle_of_three_has_all_that_the_pages_use(self):
        made = self.made(NAMES, None)
        self.assertIn("Scene", made)
        self.assertEqual([name for name, is_there in made.items() if not is_there], [])

    def test_texts_of_numbers(self):
        expected = [(2376, 0, "2376"), (2376, 2376, "2376"), (12345678, 3, "12345678"), (5e12, 5e12, "5e12"), (-5.01234e12, 5e12, "-5.012e12"),
                    (12291.25, 60, "12291.25"), (12349.5, 60, "12349.5"), (100000000.125, 0.5, "100000000.125"), (1e6, 1, "1000000"),
                    (0, 1, "0"), (-0.0, 1, "0"), (0.1 + 0.2, 0, "0.3"), (1 / 3, 4, "0.3333"), (0.0000012345, 1e-7, "1.2345e-6"),
                    (31.41593, 20000, "31.42"), (1e-8, 4, "1e-8"), (1e-9, 4, "0"), (1e-9, 0, "1e-9"), (1.7e308, 1.7e308, "1.7e308"), (None, 1, "–")]
        texts = self.made(TEXTS, [case[:2] for case in expected])
        self.assertEqual(texts, [text for *_, text in expected])

    def test_texts_tell_the_ends_of_a_range_apart(self):
        source = random.Random(7)
        pairs = []
        for _ in range(3000):
            range_ = 10 ** source.uniform(-9, 12) if source.random() < 0.7 else source.randint(1, 10 ** source.randint(1, 9))
            low = source.choice([0, source.uniform(-1, 1), source.randint(-10**6, 10**6), source.uniform(-1, 1) * range_ * 10 ** source.randint(0, 6)])
            pairs.append((low, low + range_))
        pairs = [(low, high) for low, high in pairs if high - low > 1e-9 * max(abs(low), abs(high))]
        texts = iter(self.made(TEXTS, [(value, high - low) for low, high in pairs for value in (low, high)]))
        for low, high in pairs:
            for value in (low, high):
                text = next(texts)
                self.assertLessEqual(abs(float(text) - value), (high - low) / 1000, (low, high, text))
                self.assertLess(len(text), 20, (low, high, text))
                if value == int(value) and abs(value) < 1e9:
                    self.assertEqual(float(text), value, (low, high, text))

    def test_decimated_curves_keep_extremes_and_gaps(self):
        source = random.Random(3)
        given = [([None if source.random() < gaps else source.randint(-9, 9) for _ in range(source.randint(1, 400))], source.choice([1, 7, 50]))
                 for gaps in (0, 0.02, 0.5, 1) for _ in range(20)]
        for (values, size), pieces in zip(given, self.made(PIECES, given)):
            at, expected = 0, []
            while at < len(values):
                if values[at] is None:
                    at += 1
                    continue
                end = at
                while end < len(values) and values[end] is not None:
                    end += 1
                expected.append((at, end))
                at = end
            self.assertEqual([(piece[0], piece[-1] + 1) for piece in pieces], expected)
            for piece, (first, end) in zip(pieces, expected):
                self.assertEqual(piece, sorted(set(piece)))
                for column in range(first // size, (end - 1) // size + 1):
                    frames = range(max(first, column * size), min(end, (column + 1) * size))
                    shown = [values[f] for f in piece if f in frames]
                    self.assertLessEqual(len(shown), 4)
                    self.assertEqual((min(shown), max(shown)), (min(values[f] for f in frames), max(values[f] for f in frames)))

    def test_a_frame_draws_the_cursor_alone(self):
        first, second, third = self.made(DRAWING, {"values": [1e8 + 0.1 * (f % 7) for f in range(20000)]})
        lines = [len([call for call in calls if call[0] == "line"]) for calls in (first, second, third)]
        self.assertTrue(200 < lines[0] <= 4 * 200, lines)
        self.assertEqual(lines[1:], [0, 0])
        self.assertEqual([len([call for call in calls if call[0] == "cursor"]) for calls in (first, second, third)], [1, 1, 1])
        now, ends = (call[1:] for call in second if call[0] == "text")
        self.assertEqual((now[0], ends[0]), ("100000000.1", "100000000 to 100000000.6"))
        self.assertLess(ends[1] + ends[3], now[1] - 6 * len(now[0]), "the texts overlap")


if __name__ == "__main__":
    unittest.main()
