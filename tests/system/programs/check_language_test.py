"""scripts/check-language counts what the tests of the language compare, and tells a difference with the seed that repeats it."""
import sys

from programs import *

SCRIPT = str(ROOT / "scripts/check-language")
# A test program that compares one case a seed and knows the seeds that it was given.
PROGRAM = """#!{python}
import json, os, sys
first, count = int(os.environ["APRON_PROGRAM_FIRST"]), int(os.environ["APRON_PROGRAM_SEEDS"])
print(first, count, file=open("{log}", "a"))
json.dump({{"testsuites": [{{"testsuite": [{{"name": "a", "cases": str(count)}}, {{"name": "b"}}]}}]}}, open(os.environ["GTEST_OUTPUT"][5:], "w"))
if {wrong} in range(first, first + count):
    sys.exit(print("A.cpp:3: Failure\\nseed {wrong}, avx2: 2, not 3") or 1)
"""


class CheckLanguage(ProgramTest):
    def check(self, *flags, wrong=-1):
        bin_folder = self.folder / "bin"
        bin_folder.mkdir()
        for name in ("apron_properties", "apron_vm_test", "apron_target_c_test"):
            (bin_folder / name).write_text(PROGRAM.format(python=sys.executable, log=self.folder / "log", wrong=wrong))
            (bin_folder / name).chmod(0o755)
        return self.run_program(SCRIPT, "--bin", str(bin_folder), *flags)

    def test_counts_seeds_and_cases(self):
        status, out, err = self.check("--minutes", "0.1", "--seed", "7", "--only", "integers", "mathematics")
        self.assertEqual((status, err), (0, ""))
        runs = [tuple(map(int, line.split())) for line in (self.folder / "log").read_text().splitlines()]
        self.assertEqual(runs[0], (7, 1))
        self.assertGreater(max(count for _, count in runs), 8, "batches grow")
        counted = {line.split()[0]: line for line in out.splitlines()}
        self.assertRegex(counted["integers"], r"seeds .* programs +0 differences")
        batches = [first + count for first, count in runs if count > 1]
        self.assertIn(f" {max(batches) - 7:,} seeds".replace(",", " "), counted["integers"])

    def test_tells_a_difference_and_goes_on_after_it(self):
        status, out, err = self.check("--minutes", "0.1", "--only", "functions", wrong=3)
        self.assertEqual((status, err), (1, ""))
        self.assertIn("functions, seed 3: Failure\nseed 3, avx2: 2, not 3", out)
        self.assertIn("again: APRON_PROGRAM_FIRST=3 APRON_PROGRAM_SEEDS=1 ", out)
        self.assertIn("'--gtest_filter=Function.RandomPrograms*'", out)
        self.assertIn(" 1 differences", out)
        self.assertIn("\n4 ", (self.folder / "log").read_text())

    def test_writes_its_table(self):
        tree = self.folder / "tree"
        for folder in ("scripts", "docs"):
            (tree / folder).mkdir(parents=True)
        for script in ("check-language", "built.py"):
            (tree / "scripts" / script).write_text((ROOT / "scripts" / script).read_text())
        (tree / "docs/reliability.md").write_text((ROOT / "docs/reliability.md").read_text())
        bin_folder = self.folder / "bin"
        self.check("--minutes", "0", "--only", "c")
        status, _, err = self.run_program(sys.executable, str(tree / "scripts/check-language"), "--bin", str(bin_folder), "--minutes", "0",
                                          "--page", "--only", "c", "calls")
        self.assertEqual((status, err), (0, ""))
        block = (tree / "docs/reliability.md").read_text().partition("<!-- language: written")[2].partition("<!-- end of language")[0]
        self.assertIn("| programs as C for boards, on random tiles | 1 | 1 programs | 0 |", block)
        self.assertIn("| together, in 0 minutes from seed 1 on | 2 | | 0 |", block)

    def test_what_is_missing_is_one_line(self):
        for flags, fact in ((["--only", "poems"], "invalid choice"), (["--bin", str(self.folder)], "apron_properties is not there")):
            status, _, err = self.run_program(SCRIPT, *flags)
            self.assertNotEqual(status, 0)
            self.assertIn(fact, err)


if __name__ == "__main__":
    unittest.main()
