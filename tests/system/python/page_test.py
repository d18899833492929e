"""Runs the pages about Python as notebooks: writes the files that they show, then executes their Python blocks in order, and of
some pages the commands."""
import importlib
import os
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

try:
    import gymnasium  # noqa: F401
    import onnx  # noqa: F401
    import onnxruntime  # noqa: F401
    import pettingzoo  # noqa: F401
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ROOT

# A file with its name, a block, or a command in a line of its own.
STEP = re.compile(r"(?:^`([\w./-]+)`:\n\n)?^```(\w+)\n(.*?)^```|^    ((?:smartsurf|apron) [^\n]*)$", re.DOTALL | re.MULTILINE)


class Page(unittest.TestCase):
    def runs(self, page, with_commands):
        """The number of blocks and of commands."""
        text = (ROOT / "docs" / page).read_text()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        os.chdir(folder.name)
        self.addCleanup(os.chdir, "/")
        sys.path.insert(0, folder.name)
        self.addCleanup(sys.path.remove, folder.name)
        importlib.invalidate_caches()
        os.environ.update(SMARTSURF_PYTHON=sys.executable)
        names, blocks, commands = {}, 0, 0
        for file, language, content, _ in STEP.findall(text):
            if file:
                with open(file, "w", encoding="utf-8") as out:
                    out.write(content)
        for file, language, content, command in STEP.findall(text):
            if command and with_commands:
                program, *arguments = shlex.split(command)
                if arguments[0] == "train":  # once is enough
                    arguments += ["--iterations", "1", "--candidates", "4", "--runs", "1"]
                done = subprocess.run([os.environ[program.upper()], *arguments], capture_output=True, text=True, timeout=120)
                self.assertEqual(done.returncode, 0, f"{command}: {done.stderr[-1000:]}")
                commands += 1
            elif language == "python" and not file:
                exec(compile(content, page, "exec"), names)
                blocks += 1
        return blocks, commands

    def test_python(self):
        self.assertGreaterEqual(self.runs("python.md", False)[0], 12)

    def test_first_policy(self):
        self.assertEqual(self.runs("first-policy.md", True), (3, 5))

    def test_learning(self):
        self.assertEqual(self.runs("learning.md", True), (1, 3))


if __name__ == "__main__":
    unittest.main()
