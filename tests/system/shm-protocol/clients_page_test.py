#!/usr/bin/env python3
"""Every example that docs/protocol-clients.md shows is, word for word, the file that the tests build and run.

usage: clients_page_test.py SOURCE_ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
page = (root / "docs/protocol-clients.md").read_text(encoding="utf-8")
blocks = re.findall(r"^`shm-protocol/examples/(\S+)`:\n\n```\w+\n(.*?)^```", page, re.M | re.S)
shown = dict(blocks)
expected = {"controller.c", "controller.py", "surface.c"}
if shown.keys() != expected:
    sys.exit(f"the page shows {sorted(shown)}, not {sorted(expected)}")
for name, text in shown.items():
    if text != (root / "shm-protocol/examples" / name).read_text(encoding="utf-8"):
        sys.exit(f"{name}: the page and the file differ")
