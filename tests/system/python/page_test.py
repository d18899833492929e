"""Runs docs/python.md as a notebook: writes the files that it shows, then executes its Python blocks in order."""
import os
import re
import sys
import tempfile
import unittest

try:
    import gymnasium  # noqa: F401
    import pettingzoo  # noqa: F401
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ROOT


class Page(unittest.TestCase):
    def test_every_block_runs(self):
        page = (ROOT / "docs/python.md").read_text()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            self.addCleanup(os.chdir, "/")
            files = re.findall(r"^`([\w./-]+)`:\n\n```\w+\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
            for name, text in files:
                with open(name, "w", encoding="utf-8") as out:
                    out.write(text)
            os.environ["GENERATIONS"] = "1"  # as the page says
            names, blocks = {}, re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
            for block in blocks:
                exec(compile(block, "docs/python.md", "exec"), names)
        self.assertGreaterEqual(len(blocks), 12)


if __name__ == "__main__":
    unittest.main()
