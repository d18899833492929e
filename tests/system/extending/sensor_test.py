#!/usr/bin/env python3
"""Tests the sensor of docs/extending.md: its readings and its validation."""
import pathlib
import subprocess
import sys
import tempfile

program, experiment = sys.argv[1:]


def run(*arguments):
    return subprocess.run([program, *arguments], capture_output=True, text=True, timeout=50)


done = run("run", experiment, "--no-controller", "--ticks", "8")
assert done.returncode == 0, done.stderr
standing, falling = map(float, done.stdout.split())
assert standing == 0.0, standing
assert abs(falling - 9.81 * 0.1) < 0.05, falling

with tempfile.TemporaryDirectory() as folder:
    wrong = pathlib.Path(folder) / "wrong.lua"
    wrong.write_text("surface { sensors = { speed { rang = 6 } } }\n")
    refused = run("check", str(wrong))
    assert refused.returncode == 2 and "did you mean 'range'?" in refused.stderr, refused.stderr
    wrong.write_text("surface { sensors = { speed { direction = {0, 0, 0} } } }\n")
    assert "speed.direction: must not be of length 0" in run("check", str(wrong)).stderr
