#!/usr/bin/env python3
"""Relocation with broken pins, many seeds, on a Ray cluster.

  PYTHONPATH=smartsurf/python python3 scripts/cluster/ray_sweep.py [--address ADDRESS] [--seeds N]

Without --address Ray starts on this machine. Other nodes need the checkout at the same path.
"""
import argparse
import pathlib

import ray

from smartsurf.run import run
from smartsurf.sweep import wilson

TASKS = pathlib.Path(__file__).resolve().parent.parent / "tasks"

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--address", help="address of a running cluster, or auto [this machine]")
    parser.add_argument("--seeds", type=int, default=8, help="runs per share of dead pins [8]")
    how = parser.parse_args()
    ray.init(how.address, include_dashboard=False, log_to_driver=False)
    # Raised errors are repeated once; a run that takes more than a minute is one.
    relocate = ray.remote(run).options(num_cpus=1, max_retries=1, retry_exceptions=True)
    runs = {dead: [relocate.remote(TASKS / "relocate.lua", str(TASKS / "relocate.aps"), seed, {"dead": dead}, until=30, threads=1,
                                   timeout=60) for seed in range(1, how.seeds + 1)] for dead in (0, 0.05, 0.2)}
    for dead, references in runs.items():
        won = sum(stats["metrics"]["success"] for stats in ray.get(references))
        low, high = wilson(won, how.seeds)
        print(f"dead pins {dead:4.0%}: {won:.0f} of {how.seeds} succeed ({low:.0%} to {high:.0%})")
