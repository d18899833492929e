"""scripts/sweep: each point runs once, results form tables, interrupted sweeps resume; smartsurf.run; cluster engines."""
import concurrent.futures
import contextlib
import csv
import fcntl
import functools
import importlib.machinery
import importlib.util
import math
import multiprocessing
import pickle
import random
import re
import shutil
import sys

from programs import *

sys.path.insert(0, str(ROOT / "smartsurf/python"))
from smartsurf._files import ResultError, replaced  # noqa: E402
from smartsurf.run import RunError, plot, run  # noqa: E402
from smartsurf.success import success_curve, time_of_share  # noqa: E402
from smartsurf.sweep import COLOURS, Point, folder_name, quantile, rows, samples, summary, wilson, write_csv  # noqa: E402

SWEEP = str(ROOT / "scripts/sweep")

TABLE = """
local weight, seed_digit = option('weight', 1.0, 'a number'), random(0, 1)
surface { rows = 4, columns = 4, actuator = pin {} }
if weight < 0 then error('no such weight') end
on_finish(function() metric('product', weight * 10) metric('chance', seed_digit) end)
"""

# Like Slurm, sbatch reads the script from standard input and runs it once per array task.
SBATCH = """#!/bin/sh
script=$(mktemp) && cat >"$script"
for word in "$@"; do case $word in --array=1-*) last=${word#--array=1-} last=${last%\\%*} ;; esac; done
echo "$@" >sbatch.words
for task in $(seq "$last"); do SLURM_ARRAY_TASK_ID=$task sh "$script"; done
rm "$script"
echo 4711
"""


class RunFunction(ProgramTest):
    """smartsurf.run: statistics as a dict, errors as exceptions, all of it picklable."""

    def setUp(self):
        super().setUp()
        self.run = functools.partial(run, self.write("table.lua", TABLE), smartsurf=SMARTSURF, until=0.1)

    def test_returns_statistics_of_seed_and_options(self):
        first, other = self.run(seed=3, set={"weight": 2.5}), self.run(seed=4)
        self.assertEqual((first["seed"], first["ticks"], first["metrics"]["product"]), (3, 6, 25))
        self.assertNotEqual(first["metrics"]["chance"], other["metrics"]["chance"])
        packed = self.run(seed=3, worlds=2)["runs"]
        self.assertEqual([r["metrics"]["chance"] for r in packed], [r["metrics"]["chance"] for r in (first, other)])

    def test_values_of_options_are_as_scripts_have_them(self):
        self.write("table.lua", TABLE + "if option('flag', false, '') then metric('flag', 1) end\n")
        values = [True, False]
        with contextlib.suppress(ImportError):
            import numpy as np
            values += [np.True_, np.False_]
        for value in values:
            stats = self.run(set={"flag": value, "weight": 2.0})
            self.assertEqual((stats["metrics"].get("flag"), stats["metrics"]["product"]), (1 if value else None, 20))

    def test_runs_in_other_processes(self):
        with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            there = [pool.submit(self.run, seed=seed) for seed in (1, 2)]
            self.assertEqual([t.result()["state_hash"] for t in there], [self.run(seed=s)["state_hash"] for s in (1, 2)])
            with self.assertRaises(RunError) as caught:
                pool.submit(self.run, set={"weight": -1}).result()
        self.assertEqual(caught.exception.status, 2)

    def test_package_exports_the_function(self):
        # The module has the same name: importing it must not hide the function.
        import smartsurf
        import smartsurf.run
        self.assertIs(smartsurf.run, run)
        self.assertIs(smartsurf.RunError, RunError)
        self.assertIs(smartsurf.plot, plot)

    def test_errors_are_one_line_with_status(self):
        with self.assertRaises(RunError) as caught:
            self.run(set={"weigth": 1})
        self.assertEqual(caught.exception.status, 2)
        self.assertIn("did you mean 'weight'?", str(caught.exception))
        again = pickle.loads(pickle.dumps(caught.exception))
        self.assertEqual((str(again), again.status), (str(caught.exception), 2))
        with self.assertRaises(FileNotFoundError):
            self.run(smartsurf="no/such/smartsurf")

    def test_timeout_ends_simulator_and_controller(self):
        mark = self.folder / "pid"
        with self.assertRaises(RunError) as caught:
            self.run(until=None, controller=f"echo $$ >{mark}; exec sleep 1000", timeout=5)
        self.assertEqual((caught.exception.status, str(caught.exception)), (124, "timed out after 5 s"))
        pid = mark.read_text().strip()
        self.wait_for(lambda: not pathlib.Path(f"/proc/{pid}").exists(), "the end of the controller")


class SweepStatistics(unittest.TestCase):
    def test_wilson_interval_matches_published_values(self):
        # Newcombe 1998, table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
        for successes, runs, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0, 0.1611),
                                           (1, 29, 0.0061, 0.1718)):
            interval = wilson(successes, runs)
            self.assertAlmostEqual(interval[0], low, places=4)
            self.assertAlmostEqual(interval[1], high, places=4)
        self.assertEqual(wilson(0, 0), (0, 1))

    def test_product_limit_matches_published_values(self):
        # Freireich et al. 1963, 6-MP: weeks in remission, + still so; survival and log(-log) interval as in Kalbfleisch and
        # Prentice 2002, example 1.1, and in the usual packages.
        weeks = "6 6 6 6+ 7 9+ 10 10+ 11+ 13 16 17+ 19+ 20+ 22 23 25+ 32+ 32+ 34+ 35+".split()
        curve = success_curve([None if week.endswith("+") else float(week) for week in weeks], [float(week.rstrip("+")) for week in weeks])
        expected = [(6, .8571, .6197, .9516), (7, .8067, .5631, .9228), (10, .7529, .5032, .8894), (13, .6902, .4316, .8491),
                    (16, .6275, .3675, .8049), (22, .5378, .2678, .7468), (23, .4482, .1881, .6801)]
        self.assertEqual([(step.time_s, round(1 - step.share, 4), round(1 - step.high, 4), round(1 - step.low, 4)) for step in curve], expected)
        self.assertEqual(time_of_share(curve, 0.5), (23, 13, None))

    def test_product_limit_is_the_share_where_all_are_watched_to_the_end(self):
        source = random.Random(5)
        for runs in range(1, 40):
            times = [round(source.expovariate(1), 1) if source.random() < 0.7 else None for _ in range(runs)]
            curve = success_curve(times, [100.0] * runs)
            for step in curve:
                self.assertAlmostEqual(step.share, sum(t is not None and t <= step.time_s for t in times) / runs)
                self.assertTrue(0 <= step.low <= step.share <= step.high <= 1, step)
        self.assertEqual(success_curve([None, None], [1, 2]), [])
        self.assertEqual(time_of_share([], 0.5), (None, None, None))

    def test_median_interval_covers_the_median(self):
        # 400 draws of 30 exponential times, watched for one mean: the true median is ln 2.
        source, covered = random.Random(11), 0
        for _ in range(400):
            times = [source.expovariate(1) for _ in range(30)]
            _, low, high = time_of_share(success_curve([t if t < 1 else None for t in times], [1.0] * 30), 0.5)
            covered += (low or 0) <= math.log(2) and (high is None or high >= math.log(2))
        self.assertTrue(0.92 * 400 <= covered <= 0.99 * 400, covered)

    def test_quantiles_interpolate(self):
        self.assertEqual([quantile([4, 1, 3, 2], q) for q in (0, 0.25, 0.5, 1)], [1, 1.75, 2.5, 4])

    def test_latin_hypercube_has_one_point_per_stratum(self):
        points = samples([("x", ["-1:1.0"]), ("n", ["0:9"]), ("kind", ["a", "b"])], 10, "latin-hypercube", 7)
        columns = list(zip(*[[value for _, value in point] for point in points]))
        self.assertEqual(sorted(int((float(x) + 1) * 5) for x in columns[0]), list(range(10)))
        self.assertEqual(sorted(columns[1]), [str(n) for n in range(10)])
        self.assertEqual(sorted(columns[2]), ["a"] * 5 + ["b"] * 5)
        self.assertNotEqual(points, samples([("x", ["-1:1.0"]), ("n", ["0:9"]), ("kind", ["a", "b"])], 10, "latin-hypercube", 8))

    def test_random_search_covers_range_independently(self):
        points = samples([("n", ["1:6"])], 600, "random", 1)
        counts = [points.count((("n", str(face)),)) for face in range(1, 7)]
        self.assertEqual(sum(counts), 600)
        self.assertTrue(all(60 < count < 140 for count in counts), counts)

    def test_any_statistics_are_read_or_refused_in_one_line(self):
        source = random.Random(17)
        texts = ["{", "", "nul", "[1]", "5", "\"a\"", "\xff", '{"a": 1, "a"}', '{"a":' * 20 + "1" + "}" * 20, "[" * 3000, '{"simulated_s": "x"}']

        def value(levels):
            kind = source.randrange(9 if levels else 6)
            if kind < 6:
                return source.choice(("1", "-2.5", "1" + "0" * 400, "1" + "0" * 5000, "1e999", "-1e308", "1e308", "NaN", "-Infinity", "null", "true",
                                      '"text"', '"\\ud800"', '"\\n,"', str(2**64), str(2**64 - 1), str(-2**63)))
            inner = [value(levels - 1) for _ in range(source.randint(0, 3))]
            return f"[{','.join(inner)}]" if kind == 6 else "{" + ",".join(f"{self.name(source)}:{one}" for one in inner) + "}"

        with tempfile.TemporaryDirectory() as folder:
            point, refused = Point(pathlib.Path(folder), (), 1, "digest"), 0
            point.folder.mkdir(parents=True)
            (point.folder / "status").write_text("0 digest {}\n")
            for text in texts + ["{" + ",".join(f"{self.name(source)}:{value(3)}" for _ in range(4)) + "}" for _ in range(400)]:
                (point.folder / "stats.json").write_bytes(text.encode("latin-1"))
                try:
                    table = summary([point], "success", [0.25])
                    write_csv(pathlib.Path(folder, "a.csv"), table + rows([point]))
                    json.dumps(table, allow_nan=False)
                except ResultError as error:
                    refused += 1
                    self.assertTrue(str(error).startswith(f"{point.folder}/stats.json: is damaged: ") and "\n" not in str(error), error)
                else:
                    self.assertEqual(point.read("stats.json"), json.loads(text))
                    self.assertNotRegex(json.dumps(json.loads(text)), "^[^{]|NaN|Infinity|0{400}|ud80")
            self.assertTrue(100 < refused < 400, refused)

    def name(self, source):
        return '"' + source.choice(("metrics", "success", "success_s", "simulated_s", "left_table", "a", "", "\\ud801")) + '"'

    def test_folders_of_points_differ(self):
        # Few letters, so that different points often read alike.
        source, points = random.Random(3), {}
        for _ in range(20000):
            options = tuple((source.choice(("a", "b", "a,b")), "".join(source.choices("/_,=ab-", k=source.randint(1, 5))))
                            for _ in range(source.randint(0, 3)))
            point = options, source.randint(1, 2)
            self.assertEqual(points.setdefault(folder_name(*point), point), point)
        self.assertEqual(folder_name((("goal", "1,2"), ("file", "a=b")), 3), "goal=1,2,file=a=b,seed=3")


class Sweep(ProgramTest):
    def sweep(self, *arguments):
        return self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out",
                                *arguments)

    def setUp(self):
        super().setUp()
        self.experiment = self.write("table.lua", TABLE)

    def results(self, name="results.csv"):
        with open(self.folder / "out" / name, newline="") as file:
            return list(csv.DictReader(file))

    def test_every_point_has_a_row(self):
        status, out, err = self.sweep("--set", "weight=1,2.5", "--seeds", "1-2,7")
        self.assertEqual(status, 0, out + err)
        rows = self.results()
        self.assertEqual([(r["weight"], r["seed"], r["exit_status"], float(r["product"])) for r in rows],
                         [("1", "1", "0", 10), ("1", "2", "0", 10), ("1", "7", "0", 10),
                          ("2.5", "1", "0", 25), ("2.5", "2", "0", 25), ("2.5", "7", "0", 25)])
        # Random numbers depend on the seed only, not on options.
        self.assertEqual(len({r["chance"] for r in rows}), 3)
        self.assertEqual(rows[0]["chance"], rows[3]["chance"])

    def test_inputs_are_kept(self):
        self.write("table.csv", "a")
        self.write("aside.lua", "return 1\n")
        self.write("table.lua", TABLE + "\nlocal file = option('file', 'x', 'a file')\nrequire 'aside'\n")
        run = self.folder / "out/runs/file=table.csv,seed=1"
        run.mkdir(parents=True)
        for link, file in (("out/results.csv", "table.lua"), ("out/summary.csv", "aside.lua"), ("out/provenance.json", "table.csv"),
                           (run / "log", "table.lua")):
            link = self.folder / link
            for make in (link.symlink_to, link.hardlink_to):
                make(self.folder / file)
                before = {path: path.read_text() for path in self.folder.rglob("*") if path.is_file()}
                status, out, err = self.sweep("--set", "file=table.csv")
                self.assertEqual((status, err.count("\n")), (2, 1), out + err)
                self.assertRegex(err, f"sweep: .*{link.name}: would overwrite .*{file}, an input of this command")
                link.unlink()
                (self.folder / "out/.lock").unlink()
                self.assertEqual({path: path.read_text() for path in self.folder.rglob("*") if path.is_file()},
                                 {path: text for path, text in before.items() if path not in (link, self.folder / "out/.lock")})

    def test_links_and_pipes_in_the_folder_are_replaced(self):
        words, out, victim = ("--seeds", "1-2", "--record", "--format", "csv,jsonl", "--y", "product"), self.folder / "out", self.folder / "victim"
        self.assertEqual(self.sweep(*words)[0], 0)
        whole = {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        self.assertEqual(len(whole), 6 + 2 * 5, whole.keys())
        for make in (lambda path: path.symlink_to(victim), lambda path: path.hardlink_to(victim), os.mkfifo):
            victim.write_text("kept")
            for name in whole:
                (out / name).unlink()
                if name.name not in ("status", ".lock"):
                    make(out / name)
            for folder in out.glob("runs/*"):
                (folder / "recording.files").symlink_to(self.folder)
            self.assertEqual(self.sweep(*words)[::2], (0, ""))
            self.assertEqual(victim.read_text(), "kept")
            self.assertEqual({path.relative_to(out) for path in out.rglob("*") if path.is_file() and not path.is_symlink()}, whole.keys())
            self.assertEqual((out / "results.svg").read_bytes(), whole[pathlib.Path("results.svg")])
            self.assertEqual([float(row["product"]) for row in self.results()], [10, 10])

    def test_what_no_run_has_left_is_refused(self):
        def replace(path, make):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
            make(path)

        words, out = ("--format", "jsonl"), self.folder / "out"
        self.assertEqual(self.sweep(*words)[0], 0)
        shutil.copytree(out, self.folder / "whole")
        point, precious = "runs/seed=1", self.folder / "precious"
        precious.mkdir()
        no_file = "is a link, a pipe or the like: must be a file"
        for name, make, fault in (
                (point, lambda path: path.symlink_to(precious), "is a link: must be a folder"),
                ("runs", lambda path: path.symlink_to(precious), "is a link: must be a folder"),
                (".lock", os.mkfifo, no_file),
                (f"{point}/status", os.mkfifo, no_file),
                (f"{point}/stats.json", os.mkfifo, no_file),
                (f"{point}/provenance.json", os.mkfifo, no_file),
                (f"{point}/provenance.json", lambda path: path.symlink_to(self.experiment), no_file),
                (f"{point}/stats.json", lambda path: path.write_text("[" * 100_000), "is damaged: has more than 32 levels")):
            shutil.rmtree(out)
            shutil.copytree(self.folder / "whole", out)
            replace(out / name, make)
            status, _, err = self.sweep(*words)
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertTrue(err.startswith(f"sweep: {out / name}: {fault}"), err)
            self.assertEqual(list(precious.iterdir()), [])

    def test_a_file_in_preparation_is_a_new_one(self):
        own, target = pathlib.Path(self.write("own", "own")), self.folder / "a.csv"
        part = target.with_name(f"a.csv.part{os.getpid()}")
        for make in (part.symlink_to, part.hardlink_to):
            make(own)
            with replaced(target) as file:
                file.write_text("new")
            self.assertEqual((own.read_text(), target.read_text(), part.exists()), ("own", "new", False))

    def test_a_metric_does_not_hide_a_statistic(self):
        self.write("table.lua", TABLE.replace("metric('product'", "metric('contacts', -7) metric('product'"))
        self.assertEqual(self.sweep("--set", "weight=1", "--y", "metrics.contacts")[0], 0)
        (row,), (summed,) = self.results(), self.results("summary.csv")
        self.assertEqual((float(row["contacts"]), float(row["metrics.contacts"])), (0, -7))
        self.assertEqual((float(summed["contacts.median"]), float(summed["metrics.contacts.median"])), (0, -7))

    def test_option_statistic_and_metric_of_one_name_have_columns_of_their_own(self):
        self.write("table.lua", TABLE.replace("option('weight'", "option('contacts'").replace(
            "metric('product'", "metric('contacts', -7) metric('won', 1) metric('product'"))
        status, out, err = self.sweep("--set", "contacts=1,2", "--seeds", "1-2", "--y", "metrics.contacts")
        self.assertEqual((status, err), (0, ""), out)
        self.assertIn("plot     ", out)
        self.assertEqual({tuple(float(row[name]) for name in ("contacts", "stats.contacts", "metrics.contacts")) for row in self.results()},
                         {(1, 0, -7), (2, 0, -7)})
        # An option and a metric.
        self.write("table.lua", TABLE.replace("option('weight'", "option('won'").replace("metric('product'", "metric('won', 1) metric('product'"))
        status, out, err = self.sweep("--set", "won=3", "--y", "metrics.won", "--success", "metrics.won")
        self.assertEqual((status, err), (0, ""), out)
        self.assertIn("won = 3: 1 of 1 succeed", out)
        self.assertIn("plot     ", out)
        (row,) = self.results()
        self.assertEqual((float(row["won"]), float(row["metrics.won"])), (3, 1))

    def test_a_plot_shows_negative_values(self):
        for values in ("weight - 4", "weight - 1.5", "weight", "0"):
            self.write("table.lua", TABLE.replace("weight * 10", values))
            status, out, err = self.sweep("--set", "weight=1,2", "--y", "product")
            self.assertEqual(status, 0, out + err)
            picture = (self.folder / "out/results.svg").read_text()
            # A point for each run in the light colour, and one of the legend, of which none lies outside the axes.
            self.assertEqual(picture.count("rgb(49.80"), 3, values)

    def test_a_sweep_whose_output_nobody_reads_does_its_work(self):
        more = "import sys; sys.path.insert(0, sys.argv[1]); from smartsurf._printable import guard_output; guard_output(); " \
            "print('a line\\n' * 100_000, 'another'); sys.exit(3)"
        for status, words in ((0, (SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out")),
                              (3, (sys.executable, "-c", more, str(ROOT / "smartsurf/python")))):
            reader, writer = os.pipe()
            os.close(reader)
            done = subprocess.run(words, cwd=self.folder, stdout=writer, stderr=subprocess.PIPE, text=True)
            os.close(writer)
            self.assertEqual((done.returncode, done.stderr), (status, ""))
        self.assertEqual(len(self.results()), 1)

    def test_reruns_only_unfinished_and_failed_points(self):
        self.assertEqual(self.sweep("--set", "weight=1", "--seeds", "1-3")[0], 0)
        runs = self.folder / "out/runs"
        (runs / "weight=1,seed=1/status").unlink()          # as if interrupted
        (runs / "weight=1,seed=2/status").write_text("1")   # as if failed
        untouched = (runs / "weight=1,seed=3/stats.json").stat().st_mtime_ns
        status, out, err = self.sweep("--set", "weight=1", "--seeds", "1-3")
        self.assertEqual(status, 0, err)
        self.assertIn("3 runs, 1 done before", out)
        self.assertEqual(untouched, (runs / "weight=1,seed=3/stats.json").stat().st_mtime_ns)
        self.assertEqual([r["exit_status"] for r in self.results()], ["0", "0", "0"])

    def test_a_folder_of_another_point_is_not_taken_as_done(self):
        self.write("table.lua", TABLE + "local part = option('part', 'a', 'a text') on_finish(function() metric('length', #part) end)\n")

        def sweep(parts):
            status, out, err = self.sweep("--set", f"part={parts}", "--jobs", "1")
            self.assertEqual(status, 0, err)
            return out.split(" done")[0], [(row["part"], float(row["length"])) for row in self.results()]
        both = [("parts/aä", 9), ("parts_aä", 9)]
        self.assertEqual(sweep("parts/aä,parts_aä"), ("2 runs, 0", both))
        self.assertEqual(sweep("parts/aä,parts_aä"), ("2 runs, 2", both))
        folder = self.folder / "out/runs/part=parts_aä,seed=1"
        status = folder / "status"
        done, digest, _ = status.read_text().split(" ", 2)
        # The status file of a run with other options, and of an earlier version, whose folder may be that of parts/aä.
        for text, before in ((f'{done} {digest} {{"part": "parts/aä"}}', 1), (f"{done} {digest}", 1)):
            status.write_text(text)
            self.assertEqual(sweep("parts/aä,parts_aä"), (f"2 runs, {before}", both))
        # One of an earlier version whose name is that of no other point is kept.
        self.assertEqual(sweep("whole"), ("1 runs, 0", [("whole", 5), *both]))
        (self.folder / "out/runs/part=whole,seed=1/status").write_text(f"{done} {digest}\n")
        self.assertEqual(sweep("whole"), ("1 runs, 1", [("whole", 5), *both]))

    def test_reruns_points_after_changes(self):
        self.write("shared.lua", "return 10")
        self.write("table.lua", TABLE.replace("weight * 10", "weight * require('shared')"))
        self.assertEqual(self.sweep("--set", "weight=1,2")[0], 0)
        self.assertIn("2 runs, 2 done before", self.sweep("--set", "weight=1,2")[1])
        self.write("shared.lua", "return 100")   # required by the experiment
        status, out, err = self.sweep("--set", "weight=1,2")
        self.assertEqual(status, 0, err)
        self.assertIn("2 runs, 0 done before", out)
        self.assertEqual([float(r["product"]) for r in self.results()], [100, 200])

    def test_tables_hold_all_runs_of_their_options(self):
        # Commands draw values and seeds; weight -1 fails.
        self.write("table.lua", "local size = option('size', 1, 'a number')\n" + TABLE)
        source, done, folders = random.Random(3), set(), set()
        for _ in range(4):
            weights, seeds = source.sample(["1", "2", "10"], 1) + source.sample(["-1", "5"], 1), source.sample(range(1, 5), 2)
            asked = [(weight, str(seed)) for weight in weights for seed in seeds]
            settings = source.sample(["weight=" + ",".join(weights), "size=1"], 2)  # in another order in other folders
            status, out, err = self.sweep(*(word for text in settings for word in ("--set", text)), "--seeds", ",".join(map(str, seeds)))
            self.assertEqual(status, 1 if "-1" in weights else 0, out + err)
            kept = sorted(done - set(asked), key=lambda run: (float(run[0]), int(run[1])))
            self.assertEqual([(row["weight"], row["seed"]) for row in self.results()], asked + kept)
            own = {(settings[0] == "size=1", run) for run in asked if run[0] != "-1"}
            self.assertIn(f"4 runs, {len(folders & own)} done before" + (f"; the tables hold {len(kept)} more" if kept else "\n"), out)
            folders |= own
            done |= {run for _, run in own}
            runs = {row["weight"]: int(row["runs"]) - int(row["failed"]) for row in self.results("summary.csv")}
            self.assertEqual({weight: count for weight, count in runs.items() if count},
                             {weight: sum(run[0] == weight for run in done) for weight in {run[0] for run in done}})
        # Runs of other options, and of another experiment.
        status, out, err = self.sweep("--set", "weight=1")
        self.assertIn(f"1 runs, 0 done before\n{len(folders)} more runs of the folder are not in the tables: they have other options", out)
        self.write("table.lua", TABLE)
        self.assertIn(f"\n{len(folders)} more runs of the folder are not", self.sweep("--set", "weight=1")[1])
        self.assertEqual(len(self.results()), 1)

    def test_figures_and_tables_are_of_one_sweep(self):
        scene = "surface { rows = 4, columns = 4, actuator = pin {} }\nlocal weight = option('weight', 1.0, 'a number')\n"
        self.write("table.lua", scene + "success(function(t) return t > 0.05 end)\n")
        kinds = {"results.jsonl", "results.svg", "success.svg", "rates.svg"}
        self.assertEqual(self.sweep("--set", "weight=1,2", "--y", "success_s", "--format", "csv,jsonl")[0], 0)
        self.assertLessEqual(kinds, {path.name for path in (self.folder / "out").iterdir()})
        self.write("table.lua", scene)
        self.assertEqual(self.sweep("--set", "weight=1,2")[0], 0)
        self.assertEqual(kinds & {path.name for path in (self.folder / "out").iterdir()}, set())

    def test_missing_figures_are_counted(self):
        # Each metric is set from a random one of the option's values 1 to 4 on, in some seeds.
        source = random.Random(7)
        starts = {f"m{i}": source.randint(1, 4) for i in range(6)}
        sets = " ".join(f"if n >= {start} and random(0, 1) < 0.7 then metric('{name}', n) end" for name, start in starts.items())
        self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\nlocal n = option('n', 1, 'a number')\n"
                                f"on_finish(function() {sets} end)\n")
        self.assertEqual(self.sweep("--set", "n=1,2,3,4", "--seeds", "1-3")[0], 0)
        rows = self.results()
        for summed in self.results("summary.csv"):
            for name in starts.keys() & rows[0].keys():
                lacking = sum(row[name] == "" for row in rows if row["n"] == summed["n"])
                self.assertEqual(summed.get(f"{name}.missing", ""), str(lacking or ""), (name, summed["n"]))
            self.assertNotIn("outcome.missing", summed)
        self.assertTrue(any(summed[f"{name}.missing"] == "3" for summed in self.results("summary.csv") for name in starts))

    def test_both_tables_have_one_name_of_a_figure(self):
        names = ["seed", "exit_status", "experiment", "contacts", "ticks", "won", "runs"]
        source = random.Random(2)
        for option in source.sample(names[3:6], 2) + ["n"]:
            metrics = " ".join(f"metric('{name}', {-7 - i})" for i, name in enumerate(names))
            self.write("table.lua", f"option('{option}', 1.0, 'a number')\nsurface {{ rows = 4, columns = 4, actuator = pin {{}} }}\n"
                                    f"on_finish(function() {metrics} end)\n")
            self.assertEqual(self.sweep("--set", f"{option}=2,3")[0], 0)
            for row in self.results():
                for i, name in enumerate(names):
                    column = name if name in ("won", "runs") and name != option else f"metrics.{name}"
                    self.assertEqual(row[column], str(float(-7 - i)), (option, name))
                    medians = {summed[f"{column}.median"] for summed in self.results("summary.csv")}
                    self.assertEqual(medians, {str(float(-7 - i))}, (option, name))
                for name in {"contacts", "ticks"}:
                    column = f"stats.{name}" if name == option else name
                    self.assertGreaterEqual(int(row[column]), 0)
                    self.assertIn(f"{column}.median", self.results("summary.csv")[0])
                self.assertNotIn("stats.seed", row)

    def test_runs_without_success_count_in_times_and_plots(self):
        # Succeeds at 10 × seed ms up to seed 3, of five; every run loses its ball at weight 2.
        self.write("table.lua", """
            local weight, seed = option('weight', 1.0, 'a number'), option('number', 1.0, 'a number')
            surface { rows = 4, columns = 4, actuator = pin {} }
            if weight > 1 then sphere { radius = .3, position = {20, 0, 1} } end
            success(function(t) return seed <= 3 and t >= seed / 10 and t or nil end)
            """)
        status, out, err = self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "1", "-o", "out", "--set", "weight=1,2",
                                            "--set", "number=1,2,3,4,5", "--y", "success_s", "--x", "number")
        self.assertEqual(status, 0, out + err)
        first, last = (next(row for row in self.results("summary.csv") if row["weight"] == "1" and row["number"] == n) for n in "15")
        self.assertEqual((first["succeeded"], float(first["success_s.median"])), ("1", 0.1))
        self.assertEqual((last["succeeded"], last["success_s.median"]), ("0", ""))
        self.assertIn("weight = 1, number = 5: 0 of 1 succeed (0.00 … 0.79)", out)
        picture = (self.folder / "out/results.svg").read_text()
        # Three runs and the legend in the light colour of each weight, two runs without success in grey.
        for colour, least in (("rgb(49.80", 4), ("rgb(91.76", 4), ("rgb(73.33", 4)):
            self.assertGreaterEqual(picture.count(colour), least, colour)

    def test_median_time_includes_runs_without_success(self):
        self.write("table.lua", """
            local late = random(0, 1)
            surface { rows = 4, columns = 4, actuator = pin {} }
            success(function(t) return late < 0.5 and t >= late and t or nil end)
            """)
        status, out, err = self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "1", "-o", "out", "--seeds", "1-20")
        self.assertEqual(status, 0, out + err)
        times = [row["success_s"] for row in self.results()]
        known, row = sorted(float(t) for t in times if t), self.results("summary.csv")[0]
        self.assertTrue(0 < len(known) < 20, times)
        self.assertEqual((row["succeeded"], row["success_s.missing"]), (str(len(known)), str(20 - len(known))))
        self.assertEqual(row["success_s.q25"], str(known[4]))
        self.assertEqual(row["success_s.median"], str(known[9]) if len(known) >= 10 else "")
        self.assertTrue((self.folder / "out/success.svg").exists())

    def test_a_metric_success_is_the_one_that_times_go_by(self):
        # success() holds from 0.1 s on but at seed 3; in the end the metric takes it from the seeds 1 and 2 and gives it to 3.
        self.write("table.lua", """
            local seed = option('number', 1, 'a number')
            surface { rows = 4, columns = 4, actuator = pin {} }
            success(function(t) return seed ~= 3 and t >= 0.1 end)
            on_finish(function() metric('success', seed > 2 and 1 or 0) metric('other', 1) end)
            """)

        def sweep(*flags):
            status, out, err = self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "1", "-o", "out", "--y", "success_s",
                                                "--x", "number", "--set", "number=1,2,3,4", *flags)
            self.assertEqual(status, 0, out + err)
            return out
        self.assertIn("number = 1: 0 of 1 succeed (0.00 … 0.79), half of the runs by – s (– … –)", sweep())
        self.assertEqual([row["success_s.median"] for row in self.results("summary.csv")], ["", "", "1.0", "0.1"])
        self.assertIn("number = 1: 1 of 1 succeed (0.21 … 1.00)\n", sweep("--success", "other"))
        # Two runs and the legend in grey: no success by then.
        self.assertEqual((self.folder / "out/results.svg").read_text().count("rgb(73.33"), 3)

    def test_a_run_that_reaches_the_end_without_success_counts(self):
        # stop(message, true) by seed 2 and 4 of the first weight, by none of the second.
        self.write("table.lua", """
            local weight, seed = option('weight', 1, 'a number'), option('number', 1, 'a number')
            surface { rows = 4, columns = 4, actuator = pin {} }
            on_tick(function(t)
              if weight == 1 and seed % 2 == 0 and t >= 0.05 then metric('won', 1) stop('there', true) end
            end)
            """)
        for flags in ((), ("--success", "won")):
            status, out, err = self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.2", "-o", "out", "--seeds", "1-2",
                                                "--set", "number=1,2,3,4", "--set", "weight=1,2", *flags)
            self.assertEqual(status, 0, out + err)
            rates = {(row["weight"], row["number"]): row["success_rate"] for row in self.results("summary.csv")}
            self.assertEqual([rates["1", n] for n in "1234"], ["0.0", "1.0", "0.0", "1.0"])
            self.assertEqual([rates["2", n] for n in "1234"], ["0.0"] * 4)
        self.write("table.lua", TABLE)
        self.assertEqual(self.sweep()[0], 0)
        self.assertNotIn("success_rate", self.results("summary.csv")[0])

    def test_a_run_without_success_is_later_than_the_end(self):
        self.write("table.lua", """
            local early = random(0, 1) < 0.5
            surface { rows = 4, columns = 4, actuator = pin {} }
            on_tick(function(t) if early and t >= 0.05 then stop('there', true) end end)
            """)
        self.assertEqual(self.sweep("--seeds", "1-12")[0], 0)
        won, row = sum(r["success"] == "True" for r in self.results()), self.results("summary.csv")[0]
        self.assertTrue(0 < won < 12, won)
        self.assertAlmostEqual(float(row["success_rate"]), won / 12)
        if "success_s.q90" in row:
            self.assertEqual(row["success_s.q90"], "")

    def test_a_value_may_hold_a_comma(self):
        self.write("table.lua", TABLE.replace("option('weight'", "option('name', 'a', 'a text') == '' and 0 or option('weight'"))
        status, out, err = self.sweep("--set", r"name=a\,b,c")
        self.assertEqual(status, 0, out + err)
        self.assertEqual([r["name"] for r in self.results()], ["a,b", "c"])

    def test_summary_has_rates_medians_and_quantiles(self):
        self.write("table.lua", TABLE.replace("metric('chance'", "metric('success', weight > 1 and seed_digit > 0.2 and 1 or 0) "
                                                                "metric('chance'"))
        self.assertEqual(self.sweep("--set", "weight=1,2", "--seeds", "1-5", "--quantiles", "0,0.9")[0], 0)
        rows, (no, maybe) = self.results(), self.results("summary.csv")
        self.assertEqual((no["weight"], no["runs"], no["failed"], no["success_rate"], no["success_low"]),
                         ("1", "5", "0", "0.0", "0.0"))
        won = sum(float(r["success"]) for r in rows if r["weight"] == "2")
        self.assertTrue(0 < won < 5, "the seeds give both outcomes")
        self.assertAlmostEqual(float(maybe["success_rate"]), won / 5)
        self.assertAlmostEqual(float(maybe["success_high"]), wilson(int(won), 5)[1])
        chances = sorted(float(r["chance"]) for r in rows if r["weight"] == "2")
        self.assertEqual(float(maybe["chance.median"]), chances[2])
        self.assertEqual(float(maybe["chance.q0"]), chances[0])
        self.assertAlmostEqual(float(maybe["chance.q90"]), chances[3] + 0.6 * (chances[4] - chances[3]))

    def test_packed_worlds_equal_single_runs(self):
        self.assertEqual(self.sweep("--seeds", "1-3,7", "--worlds", "4", "--record")[0], 0)
        packed = [(r["seed"], r["chance"], r["state_hash"]) for r in self.results()]
        provenance = [json.loads((self.folder / f"out/runs/seed={s}/provenance.json").read_text()) for s in (1, 2, 3, 7)]
        self.assertEqual([p["worlds"] for p in provenance], [3, 3, 3, 1])
        for seed, _, state_hash in packed:
            self.assertIn(state_hash, self.run_program(SMARTSURF, "info", f"out/runs/seed={seed}/recording.h5")[1])
        self.assertEqual(self.sweep("--seeds", "1-3,7", "-o", "single")[0], 0)
        with open(self.folder / "single/results.csv", newline="") as file:
            self.assertEqual([(r["seed"], r["chance"], r["state_hash"]) for r in csv.DictReader(file)], packed)

    def test_packed_worlds_write_into_the_folders_of_their_runs(self):
        files = "on_finish(function() local f = io.open('chance.txt', 'w') f:write(seed_digit) f:close() end)\n"
        self.write("table.lua", TABLE + files)
        for words in (("--worlds", "3"), ("--worlds", "1")):
            self.assertEqual(self.sweep("--seeds", "1-3", "--record", "-o", words[1], *words)[0], 0)
        names, single = ({file.relative_to(out): file for file in out.rglob("*") if file.is_file()}
                         for out in (self.folder / "3/runs", self.folder / "1/runs"))
        self.assertEqual(names.keys(), single.keys())
        written = [name for name in names if name.name == "chance.txt"]
        self.assertEqual(len({names[name].read_text() for name in written}), 3)
        self.assertEqual([names[name].read_text() for name in written], [single[name].read_text() for name in written])
        # A world that fails leaves what a single run leaves.
        self.write("table.lua", TABLE + files + "at(0.05, function() if seed_digit < 0.5 then error('bad luck') end end)\n")
        self.assertEqual(self.sweep("--seeds", "2-6", "--worlds", "5", "--record")[0], 1)
        self.assertEqual({path.name for path in self.folder.glob("out/runs/*/*")},
                         {"log", "provenance.json", "recording.files", "recording.h5", "stats.json", "status"})
        self.assertEqual(len({file.read_text() for file in self.folder.glob("out/runs/*/recording.files/*")}),
                         [row["exit_status"] for row in self.results()].count("0"))

    def test_failing_world_of_a_pack_is_reported_alone(self):
        self.write("table.lua", TABLE.replace("on_finish", "if seed_digit < 0.5 then error('bad luck') end\non_finish"))
        status, _, err = self.sweep("--seeds", "2-6", "--worlds", "5")
        self.assertEqual(status, 1)
        self.assertIn("bad luck", err)
        statuses = [r["exit_status"] for r in self.results()]
        self.assertEqual(set(statuses), {"0", "2"})
        for row in self.results():
            self.assertEqual(row["exit_status"] == "0", row["chance"] != "")

    def test_run_that_takes_too_long_is_ended(self):
        self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n"
                                "option('weight', 1.0, 'a number') pace('realtime')")
        status, _, err = self.sweep("--until", "1000", "--timeout", "0.5")
        self.assertEqual(status, 1)
        self.assertIn("seed=1: timed out after 0.5 s", err)
        self.assertEqual(self.results()[0]["exit_status"], "124")

    def test_retry_repeats_failures_only(self):
        idle = self.write("idle.aps", "repeat(6)\nsurface.step\nendrepeat\n")
        flaky = self.write("flaky.sh", f"""echo run >>{self.folder}/tries
[ $(wc -l <{self.folder}/tries) -gt "$1" ] || exit 7
exec {APRON} run {idle} --shm "$2"
""")
        self.assertEqual(self.sweep("--controller", f"sh {flaky} 2 {{shm}}", "--retry", "2")[0], 0)
        self.assertEqual(json.loads((self.folder / "out/runs/seed=1/provenance.json").read_text())["attempts"], 3)
        (self.folder / "tries").unlink()
        self.assertEqual(self.sweep("--controller", f"sh {flaky} 9 {{shm}}", "--retry", "1")[0], 1)
        self.assertEqual((self.folder / "tries").read_text(), "run\n" * 2)

    def test_an_interrupted_sweep_starts_nothing_and_resumes(self):
        # A simulator that never ends by itself.
        stuck = self.write("stuck", """#!/bin/sh
            [ "$1" = run ] || exec true
            echo run >>starts
            exec sleep 1000
            """)
        os.chmod(stuck, 0o755)
        for number, flags in ((signal.SIGINT, ("--worlds", "4")), (signal.SIGTERM, ("--jobs", "1", "--retry", "2"))):
            starts = self.folder / "starts"
            sweep = self.start(SWEEP, self.experiment, "--smartsurf", stuck, "--until", "0.1", "-o", "out", "--seeds", "1-4", *flags)
            self.wait_for(lambda: starts.exists() and starts.read_text(), "the first run")
            sweep.send_signal(number)
            self.assertEqual(self.finish(sweep), (128 + number, "4 runs, 0 done before\n", ""))
            self.assertEqual(starts.read_text(), "run\n")
            starts.unlink()
            self.assertEqual(list(self.folder.glob("out/runs/*/status")), [])
        status, out, err = self.sweep("--seeds", "1-4", "--worlds", "4")
        self.assertEqual((status, [row["exit_status"] for row in self.results()]), (0, ["0"] * 4), err)

    def test_samples_are_drawn_once_per_seed_of_the_search(self):
        words = ("--set", "weight=2:4.0", "--samples", "4", "--seeds", "1-2")
        self.assertEqual(self.sweep(*words)[0], 0)
        weights = [float(r["weight"]) for r in self.results()]
        self.assertEqual(len(weights), 8)
        self.assertEqual(sorted(int((w - 2) * 2) for w in weights), [0, 0, 1, 1, 2, 2, 3, 3])
        self.assertIn("8 runs, 8 done before", self.sweep(*words)[1])
        self.assertIn("8 runs, 0 done before", self.sweep(*words, "--search", "random")[1])

    def test_a_range_of_a_nuisance_is_drawn_in_each_run(self):
        self.write("table.lua", TABLE + "sphere { radius = 0.4, position = {1, 1, 3} }\n")
        for value in ("0.5:1.5", "0.5:1.5:absolute", "0.5:1.5:factor"):
            status, out, err = self.sweep("--samples", "5", "--search", "random", "--vary", f"friction={value}", "--set", "weight=1,2", "--seeds", "1-2")
            self.assertEqual(status, 0, err)
            self.assertIn("2 of the 5 samples differ: each runs once\n4 runs, ", out)
            rows = self.results()[:4]  # the others follow
            self.assertEqual([(row["weight"], row["vary.friction"]) for row in rows], [(weight, value) for weight in "12" for _ in range(2)])
            self.assertEqual(len({row["varied.friction"] for row in rows}), 2)
        status, _, err = self.sweep("--samples", "3", "--vary", "friction=0.5:1.5")
        self.assertEqual((status, err.count("\n")), (2, 1), err)
        self.assertIn("--samples 3: needs the options to sample", err)

    def test_without_scipy_a_latin_hypercube_is_one_clear_line(self):
        self.write("sitecustomize.py", "import sys\nsys.modules['scipy'] = None\n")
        os.environ["PYTHONPATH"] = str(self.folder)
        self.addCleanup(os.environ.pop, "PYTHONPATH")
        words = ("--set", "weight=2:4.0", "--samples", "4")
        status, _, err = self.sweep(*words)
        self.assertEqual((status, err), (2, "sweep: --search latin-hypercube: needs SciPy: apt-get install python3-scipy, "
                                            "or --search random\n"))
        self.assertEqual(self.sweep(*words, "--search", "random")[0], 0)

    def test_jsonl_has_statistics_and_provenance(self):
        self.assertEqual(self.sweep("--set", "weight=3", "--format", "csv,jsonl")[0], 0)
        (line,) = (self.folder / "out/results.jsonl").read_text().splitlines()
        one = json.loads(line)
        self.assertEqual((one["options"], one["seed"], one["stats"]["metrics"]["product"]), ({"weight": "3"}, 1, 30))
        self.assertEqual(one["provenance"]["host"], os.uname().nodename)
        all = json.loads((self.folder / "out/provenance.json").read_text())
        self.assertEqual(all["digest"], one["provenance"]["digest"])
        self.assertIn("smartsurf ", all["version"])
        (source,) = all["sources"].items()
        digest = subprocess.run(["sha256sum", source[0]], capture_output=True, text=True).stdout.split()[0]
        self.assertEqual(source, (str(pathlib.Path(self.experiment).resolve()), digest))

    def sbatch(self, text):
        """Installs the text as sbatch and returns an environment that finds it."""
        (self.folder / "bin").mkdir(exist_ok=True)
        path = self.folder / "bin/sbatch"
        path.write_text(text)
        path.chmod(0o755)
        return {**os.environ, "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}"}

    def on_slurm(self, environment, *arguments):
        done = subprocess.run([SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out",
                               *arguments], cwd=self.folder, env=environment, capture_output=True,
                              text=True, timeout=60)
        return done.returncode, done.stdout, done.stderr

    def test_slurm_array_runs_each_point_once(self):
        environment = self.sbatch(SBATCH)
        status, out, err = self.on_slurm(environment, "--slurm=--time=10", "--set", "weight=1,2", "--seeds", "1-2")
        self.assertEqual(status, 0, err)
        self.assertIn("job 4711: 4 runs", out)
        status, out, err = self.on_slurm(environment, "--slurm=--time=10", "--set", "weight=1,2", "--seeds", "1-2")
        self.assertEqual(status, 0, err)
        self.assertIn("4 runs, 4 done before", out)
        self.assertEqual([(r["weight"], r["seed"], float(r["product"])) for r in self.results()],
                         [("1", "1", 10), ("1", "2", 10), ("2", "1", 20), ("2", "2", 20)])

    def test_slurm_accepts_every_spelling_of_its_options(self):
        environment = self.sbatch(SBATCH)
        for words, given in ((["--slurm=--time=10"], ["--time=10"]), (["--slurm", "--time=10"], ["--time=10"]),
                             (["--slurm", "--time=10 --partition=short"], ["--time=10", "--partition=short"]),
                             (["--slurm=-t 10"], ["-t", "10"]), (["--slurm", "-t 10"], ["-t", "10"]),
                             (["--slurm", "--time=10", "--exclusive"], ["--time=10", "--exclusive"]),
                             (["--slurm"], []), (["--slurm", ""], [])):
            with self.subTest(words):
                shutil.rmtree(self.folder / "out", ignore_errors=True)
                status, _, err = self.on_slurm(environment, *words, "--seeds", "1")
                self.assertEqual(status, 0, err)
                submitted = (self.folder / "sbatch.words").read_text().split()
                self.assertEqual(submitted[5:], given)

    def test_slurm_chunks_and_throttle(self):
        environment = self.sbatch(SBATCH)
        words = ("--slurm=", "--seeds", "1-5", "--chunk", "2", "--throttle", "7")
        status, out, err = self.on_slurm(environment, *words)
        self.assertEqual(status, 0, err)
        self.assertIn("5 runs in 3 array tasks", out)
        self.assertIn("--array=1-3%7", (self.folder / "sbatch.words").read_text().split())
        self.assertIn("5 runs, 5 done before", self.on_slurm(environment, *words)[1])
        # More runs than an array may have tasks.
        environment = self.sbatch("#!/bin/sh\necho \"$@\" >sbatch.words\n")
        self.assertIn("2500 runs in 834 array tasks", self.on_slurm(environment, "--slurm=", "--seeds", "1-2500", "-o", "big")[1])
        self.assertIn("--array=1-834", (self.folder / "sbatch.words").read_text().split())

    def test_slurm_jobs_are_not_submitted_twice(self):
        # Submitted and not yet run; squeue knows it until it has ended.
        environment = self.sbatch("#!/bin/sh\necho submitted >>submissions\necho 4711\n")
        squeue = self.folder / "bin/squeue"
        squeue.write_text("#!/bin/sh\n[ -f ended ] && { echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1; }\n"
                          "echo '4711_[1] PENDING'\n")
        squeue.chmod(0o755)
        self.assertEqual(self.on_slurm(environment, "--slurm=")[0], 0)
        status, _, err = self.on_slurm(environment, "--slurm=")
        self.assertEqual(status, 2)
        self.assertEqual(err, "sweep: --slurm: job 4711 of this folder has not ended: wait, or end it with scancel 4711\n")
        self.write("ended", "")
        self.assertEqual(self.on_slurm(environment, "--slurm=")[0], 0)
        self.assertEqual((self.folder / "submissions").read_text().count("submitted"), 2)

    def test_folder_is_of_one_sweep_at_a_time(self):
        (self.folder / "out").mkdir()
        with open(self.folder / "out/.lock", "w") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            status, _, err = self.sweep("--seeds", "1")
            self.assertEqual((status, err), (2, "sweep: --out out: another sweep works in this folder\n"))
        self.assertEqual(self.sweep("--seeds", "1")[0], 0)

    def test_long_options_have_folders_and_rows(self):
        long = ["1" + "0" * 300, "2" + "0" * 300]
        status, _, err = self.sweep("--set", "weight=" + ",".join(long), "--seeds", "1")
        folders = [p.name for p in (self.folder / "out/runs").iterdir()]
        self.assertEqual(len(folders), 2, err)
        self.assertTrue(all(len(name.encode()) < 255 for name in folders))
        self.assertEqual(len(self.results()), 2)
        self.assertEqual([r["weight"] for r in self.results()], long)

    def test_slurm_errors_report_one_line(self):
        environment = self.sbatch("#!/bin/sh\necho 'sbatch: error: invalid partition specified: x' >&2\nexit 1\n")
        status, _, err = self.on_slurm(environment, "--slurm=")
        self.assertEqual(status, 2)
        self.assertEqual(err, "sweep: --slurm: sbatch refuses the job: sbatch: error: invalid partition specified: x\n")

    def test_failing_point_is_named_and_others_are_kept(self):
        status, _, err = self.sweep("--set", "weight=1,-1", "--seeds", "1")
        self.assertEqual(status, 1)
        self.assertIn("weight=-1,seed=1", err)
        self.assertIn("no such weight", err)
        self.assertEqual([r["exit_status"] for r in self.results()], ["0", "2"])

    def test_plot_shows_metric(self):
        status, _, err = self.sweep("--set", "weight=1,2,3", "--seeds", "1-2", "--y", "product")
        self.assertEqual(status, 0, err)
        drawing = (self.folder / "out/results.svg").read_text()
        # Text is drawn as outlines. Six runs and three medians, in their colours, each with its entry in the legend.
        self.assertGreaterEqual(drawing.count("rgb(49.80"), 7)
        self.assertGreaterEqual(drawing.count("rgb(0%,45.09"), 4)

    def test_colours_are_those_of_all_charts(self):
        source = (ROOT / "common/color/LineColours.h").read_text()
        shares = re.findall(r"\{(\d\.\d+), (\d\.\d+), (\d\.\d+)\}", source)
        self.assertEqual(COLOURS, tuple("#" + "".join(f"{math.floor(255 * float(share) + 0.5):02x}" for share in rgb) for rgb in shares))

    def test_plot_has_the_medians_of_the_summary_and_names_what_differs(self):
        loader = importlib.machinery.SourceFileLoader("sweep_script", SWEEP)
        sweep = importlib.util.module_from_spec(importlib.util.spec_from_loader("sweep_script", loader))
        loader.exec_module(sweep)
        charts = []
        sweep.draw_chart = lambda chart, *_: charts.append(chart)

        class Run:
            def __init__(self, seed, time, b):
                self.seed, self.options, self.time = seed, (("x", "1"), ("same", "7"), ("b", b)), time

            def status(self):
                return 0

            def figures(self):
                return {"success": int(self.time is not None), "success_s": self.time, "simulated_s": 9.0}

            def figure(self, name):
                return self.figures().get(name)
        # Half of four runs have succeeded when the second has.
        runs = [Run(seed, time, b) for b in "12" for seed, time in enumerate((1.0, 2.0, 3.0, None))]
        sweep.plot(runs, "x", "success_s", 9.0, self.folder, SMARTSURF)
        medians = [layer for layer in charts[0]["layers"] if layer["mark"] == "line"]
        self.assertEqual([layer["y"] for layer in medians], [[2.0], [2.0]])
        self.assertEqual([layer["name"] for layer in medians], ["b = 1: median", "b = 2: median"])
        sweep.plot_success(runs, 9.0, self.folder, SMARTSURF)
        self.assertEqual([layer["name"] for layer in charts[1]["layers"] if "name" in layer], ["b = 1", "b = 2"])

    def test_a_legend_has_room_for_its_names(self):
        heights = []
        for name in ("runs", "small = 3, pin_speed = 4, large = 5: runs"):
            file = self.folder / "chart.svg"
            plot({"layers": [{"mark": "line", "name": f"{name} {i}", "x": [0, 1], "y": [0, 1]} for i in range(3)]}, file, SMARTSURF)
            heights.append(float(re.search(r'height="([\d.]+)', file.read_text())[1]))
        self.assertGreater(heights[1], heights[0] + 15, "a name of three does not fit into a third of the width")

    def test_a_chart_takes_arrays_and_its_error_is_one_line(self):
        file = self.folder / "chart.svg"
        lists = {"layers": [{"mark": "line", "x": [0, 1, 2, 3], "y": [0.5, None, 2.0, 1.0]}], "width": 300}
        plot(lists, file, SMARTSURF)
        expected = file.read_text()
        plot({"layers": ({"mark": "line", "x": [0, 1, 2, 3], "y": [0.5, float("nan"), 2.0, 1.0]},), "width": 300}, file, SMARTSURF)
        self.assertEqual(file.read_text(), expected)
        with self.assertRaisesRegex(RunError, r"^smartsurf: .*layers\[0\]\.mark = 'pie': must be line, point, bar or rect$") as caught:
            plot({"layers": [{"mark": "pie", "x": [0], "y": [0]}]}, file, SMARTSURF)
        self.assertEqual(caught.exception.status, 2)
        with self.assertRaisesRegex(ValueError, "^chart: has the value inf: must be finite, or NaN for a gap$"):
            plot({"layers": [{"mark": "line", "x": [0], "y": [float("inf")]}]}, file, SMARTSURF)
        try:
            import numpy as np
        except ImportError:
            self.skipTest("NumPy is missing")
        plot({"layers": [{"mark": "line", "x": np.arange(4), "y": np.array([0.5, np.nan, 2, 1], np.float32)}], "width": np.int64(300)},
             file, SMARTSURF)
        self.assertEqual(file.read_text(), expected)

    def test_plot_says_which_runs_it_leaves_out(self):
        self.write("table.lua", """
            local seed = option('number', 1, 'a number')
            surface { rows = 4, columns = 4, actuator = pin {} }
            on_finish(function() if seed > 3 then metric('late_s', seed) end metric('all', seed) end)
            """)
        for figure, said in (("late_s", "without 3 runs that have no number 'late_s'\n"), ("all", "")):
            status, out, err = self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out", "--y", figure,
                                                "--x", "number", "--set", "number=1,2,3,4,5")
            self.assertEqual((status, "without" in out), (0, bool(said)), out + err)
            self.assertIn(said, out)

    def test_invalid_arguments_report_one_line(self):
        self.write("taken", "")
        for arguments, message in (
                (("--seeds", "3-1"), "sweep: --seeds 3-1: must be like 1-10 or 1,2,5"),
                (("--seeds", "1-99999999999"), "sweep: --seeds 1-99999999999: more than 1000000 seeds"),
                (("--seeds", "18446744073709551616"), "sweep: --seeds 18446744073709551616: a seed must be at most 18446744073709551615"),
                (("--seeds", "3-18446744073709551616"), "a seed must be at most"),
                (("--seeds", "²"), "sweep: --seeds ²: must be like 1-10"),
                (("--out", "taken"), "sweep: --out taken: cannot be made a folder: File exists"),
                (("--out", "taken/below"), "sweep: --out taken/below: cannot be made a folder: Not a directory"),
                (("--set", "weight"), "sweep: --set weight: must be NAME=VALUE or NAME=VALUE,VALUE,…"),
                (("--set", "weight=1,2", "--set", "weight=3"), "sweep: --set weight=3: 'weight' is given twice"),
                (("--samples", "3"), "sweep: --samples 3: needs the options to sample"),
                (("--timeout", "-1"), "sweep: --timeout -1: must be a positive number of seconds"),
                (("--quantiles", "5"), "sweep: --quantiles 5: must be like 0.05,0.95"),
                (("--format", "xls"), "sweep: --format xls: must be of csv, jsonl and parquet"),
                (("--search", "grid"), "sweep: argument --search: invalid choice: 'grid'"),
                (("--jobs", "0"), "sweep: --jobs 0: must be a whole number from 1"),
                (("--set", "runs=1,2"), "sweep: --set runs=1,2: the tables have a column 'runs' of their own: name the option otherwise"),
                (("--set", "weigth=1"), "did you mean 'weight'?"),
                (("--until", "nan"), "sweep: --until nan: must be a number of seconds greater than 0, at most 1e9"),
                (("--until", "-1"), "sweep: --until -1: must be a number of seconds greater than 0, at most 1e9"),
                (("--success", "won"), "sweep: --success won: no such figure; there are mode, "),
                (("--x", "size"), "sweep: --x size: must be seed or one of the options of --set (none given)")):
            status, _, err = self.sweep(*arguments)
            self.assertEqual(status, 2, arguments)
            self.assertIn(message, err)
            self.assertEqual(len(err.strip().splitlines()), 1, err)


if __name__ == "__main__":
    unittest.main()
