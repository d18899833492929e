#!/usr/bin/env python3
"""Tests the actuator of docs/extending.md: its effect and its validation."""
import pathlib
import subprocess
import sys
import tempfile

program, experiment = sys.argv[1:]


def run(*arguments):
    return subprocess.run([program, *arguments], capture_output=True, text=True, timeout=50)


done = run("run", experiment, "--no-controller", "--ticks", "90")
assert done.returncode == 0, done.stderr
east, north, _ = map(float, done.stdout.split())
assert abs(east - 3.0) < 0.05 and abs(north) < 0.05, done.stdout

with tempfile.TemporaryDirectory() as folder:
    wrong = pathlib.Path(folder) / "wrong.lua"
    wrong.write_text("surface { actuator = belt { max_sped = 3 } }\n")
    refused = run("check", str(wrong))
    assert refused.returncode == 2 and "belt: unknown field 'max_sped' (did you mean 'max_speed'?)" in refused.stderr, refused.stderr
