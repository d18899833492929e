#!/usr/bin/env python3
"""Searches the options of an experiment for the least value of a metric, with Optuna.

  PYTHONPATH=smartsurf/python python3 scripts/cluster/optuna_search.py [--trials N] [--storage URL]

Several processes or nodes that are started with the same --storage (for example sqlite:///study.db, or a server's URL)
share one study. The example finds the shape of the wave that carries a ball fastest.
"""
import argparse
import pathlib

import optuna

from smartsurf.run import run

WAVE = pathlib.Path(__file__).resolve().parent / "wave.lua"


def objective(trial):
    options = {"amplitude": trial.suggest_float("amplitude", 0.1, 1.0), "wavelength": trial.suggest_float("wavelength", 4, 12),
               "frequency": trial.suggest_float("frequency", 0.2, 2.0)}
    runs = run(WAVE, seed=1, set=options, until=6, worlds=4, threads=1)["runs"]
    return sum(stats["metrics"]["speed_u_s"] for stats in runs) / len(runs)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="[20]")
    parser.add_argument("--storage", help="storage of a study that several processes share [this process]")
    how = parser.parse_args()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(study_name="wave", storage=how.storage, load_if_exists=True, direction="maximize",
                                sampler=optuna.samplers.TPESampler(seed=1))
    study.optimize(objective, n_trials=how.trials)
    print(f"after {len(study.trials)} trials: {study.best_value:.2f} u/s with " +
          ", ".join(f"{name} {value:.2f}" for name, value in study.best_params.items()))
