#!/usr/bin/env python3
"""The example that docs/protocol-clients.md shows is, word for word, the file that the tests build and run; the examples
and the calls of the C interface that it names exist.

usage: clients_page_test.py SOURCE_ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
page = (root / "docs/protocol-clients.md").read_text(encoding="utf-8")
blocks = re.findall(r"^`shm-protocol/examples/(\S+)`:\n\n```\w+\n(.*?)^```", page, re.M | re.S)
shown = dict(blocks)
expected = {"controller.py"}
if shown.keys() != expected:
    sys.exit(f"the page shows {sorted(shown)}, not {sorted(expected)}")
for name, text in shown.items():
    if text != (root / "shm-protocol/examples" / name).read_text(encoding="utf-8"):
        sys.exit(f"{name}: the page and the file differ")
named = re.findall(r"`shm-protocol/examples/([\w.]+)`", page)
if missing := sorted(name for name in named if not (root / "shm-protocol/examples" / name).exists()):
    sys.exit(f"the page names {missing}, which do not exist")
header = (root / "shm-protocol/include/shm_protocol/shm_protocol.h").read_text(encoding="utf-8")
if unknown := sorted(call for call in set(re.findall(r"\bssp_\w+", page)) if call + "(" not in header):
    sys.exit(f"the page names {unknown}, which shm_protocol.h does not declare")
