#!/usr/bin/env python3
"""Every test that promises.md names for a promise of the protocol exists, and every promise names one.

usage: promises_test.py SOURCE_ROOT CTEST_FOLDER
"""
import pathlib
import re
import subprocess
import sys

root, build = pathlib.Path(sys.argv[1]), sys.argv[2]
table = pathlib.Path(__file__).with_name("promises.md").read_text(encoding="utf-8")
promises = re.findall(r"^\| (?!promise)([^|-][^|]*) \| (.*) \|$", table, re.M)

tests = set()  # Suite.Test, from the sources: soak tests and the like too
for source in (root / "tests").rglob("*.cpp"):
    tests |= {".".join(found) for found in
              re.findall(r"^TEST(?:_F|_P)?\((\w+), (\w+)\)", source.read_text(encoding="utf-8"), re.M)}
listed = subprocess.run(["ctest", "-N"], cwd=build, check=True, capture_output=True, text=True).stdout
in_ctest = set(re.findall(r"Test +#\d+: (\S+)", listed))
# Where these are optional, ctest does not know them: Spin, Python without NumPy, sanitized builds.
optional = {name for name in ("model.", "shm_protocol_python_", "shm_protocol_install")
            if not any(test.startswith(name) for test in in_ctest)}


def exists(name):
    if name.endswith(".*"):
        return any(test.startswith(name[:-1]) for test in tests)
    return name in tests or name in in_ctest or any(name.startswith(prefix) for prefix in optional)


faults = [f"{promise}: names no test" for promise, names in promises if not re.search(r"`\w+[.\w*]+`", names)]
faults += [f"{promise}: there is no test {name}" for promise, names in promises
           for name in re.findall(r"`(\w+[.\w*]+)`", names) if not exists(name)]
if len(promises) < 30:
    faults.append(f"only {len(promises)} promises were found: is the table still there?")
if faults:
    sys.exit("\n".join(faults))
