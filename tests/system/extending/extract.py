#!/usr/bin/env python3
"""Extracts files from a page: every fenced block whose first line is a comment with a file name.

usage: extract.py PAGE FOLDER [NAME...]      fails if a NAME is missing
"""
import pathlib
import re
import sys

page, folder, *wanted = sys.argv[1:]
found = {}
for block in re.findall(r"^```\w+\n(.*?)^```", pathlib.Path(page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
    name = re.match(r"(?://|--) (\w+\.\w+)$", block.splitlines()[0])
    if name:
        found[name.group(1)] = block
missing = [name for name in wanted if name not in found]
if missing:
    sys.exit(f"{page}: missing {', '.join(missing)}")
pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
for name, text in found.items():
    (pathlib.Path(folder) / name).write_text(text, encoding="utf-8")
