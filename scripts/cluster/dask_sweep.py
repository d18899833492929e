#!/usr/bin/env python3
"""Relocation with broken pins, many seeds, on a Dask cluster.

  PYTHONPATH=smartsurf/python python3 scripts/cluster/dask_sweep.py [--scheduler ADDRESS] [--seeds N]

Without --scheduler a local cluster of one worker per core starts. Workers need the checkout at the same path; dask-jobqueue
starts them on Slurm, PBS, SGE, LSF or HTCondor.
"""
import argparse
import functools
import pathlib

from dask.distributed import Client, LocalCluster

from smartsurf.run import run
from smartsurf.sweep import wilson

TASKS = pathlib.Path(__file__).resolve().parent.parent / "tasks"

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scheduler", help="address of a running scheduler [a local cluster]")
    parser.add_argument("--seeds", type=int, default=8, help="runs per share of dead pins [8]")
    how = parser.parse_args()
    relocate = functools.partial(run, TASKS / "relocate.lua", TASKS / "relocate.aps", until=30, threads=1)
    with Client(how.scheduler or LocalCluster(threads_per_worker=1, dashboard_address=None)) as client:
        runs = {dead: [client.submit(relocate, seed=seed, set={"dead": dead}, key=f"dead={dead},seed={seed}", retries=1)
                       for seed in range(1, how.seeds + 1)] for dead in (0, 0.05, 0.2)}
        for dead, futures in runs.items():
            won = sum(stats["metrics"]["success"] for stats in client.gather(futures))
            low, high = wilson(won, how.seeds)
            print(f"dead pins {dead:4.0%}: {won:.0f} of {how.seeds} succeed ({low:.0%} to {high:.0%})")
