"""Learns a policy of a task; `smartsurf train TASK`, or python -m smartsurf.train TASK.

TASK is a task of docs/tasks.md (Relocate), an experiment with reward() and episode{} (plate.lua), or a smartsurf.Task
(turn.py:TurnBox). FOLDER [out/train/TASK-METHOD] receives curve.csv, by samples and processor time, the same for TensorBoard
where that is installed, and after each iteration the policy: policy.onnx, and if it is local policy.aps. Both are controllers
of `smartsurf run`.

  cem   the cross-entropy method (Rubinstein 1999) over the parameters of a LocalPolicy. Needs NumPy and Gymnasium alone.
  ppo   proximal policy optimization (Schulman et al. 2017), after CleanRL's. Every cell's commands are an action of their own,
        with the advantage of the world. Needs torch.

Equal arguments give equal policies, for any number of threads.
"""
from __future__ import annotations

import argparse
import os
import pathlib
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """The command. arguments: without the program's name [sys.argv]."""
    parser = argparse.ArgumentParser(prog="smartsurf train", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", metavar="TASK")
    parser.add_argument("--method", choices=("cem", "ppo"), default="cem", help="[cem]")
    parser.add_argument("--policy", choices=("local", "cnn", "mlp"), default="local", help="cem: local only [local]")
    parser.add_argument("--hidden", type=_sizes, metavar="N,…", help="units of the hidden layers, 0 for none [cem 4, ppo 16]")
    parser.add_argument("--iterations", type=_whole, default=30, help="generations or updates [30]")
    parser.add_argument("--seed", type=int, default=1, help="of everything random [1]")
    parser.add_argument("--threads", type=_whole, default=len(os.sched_getaffinity(0)), help="that compute worlds [one per core]")
    parser.add_argument("-o", "--out", type=pathlib.Path, metavar="FOLDER")
    of_cem = parser.add_argument_group("cem")
    of_cem.add_argument("--candidates", type=_whole, default=24, help="of a generation [24]")
    of_cem.add_argument("--runs", type=_whole, default=4, help="episodes of each candidate [4]")
    of_cem.add_argument("--deviation", type=float, default=0.5, help="of the parameters at the start [0.5]")
    of_cem.add_argument("--memory", type=int, default=0, help="values that each cell remembers [0]")
    of_cem.add_argument("--substeps", type=_whole, default=1, help="how often the network is applied in a tick; needs memory [1]")
    of_cem.add_argument("--neighbours", type=int, choices=(0, 4, 8), default=4, help="that each cell reads [4]")
    of_ppo = parser.add_argument_group("ppo")
    of_ppo.add_argument("--worlds", type=_whole, default=32, help="[32]")
    of_ppo.add_argument("--horizon", type=_whole, default=64, help="decisions between two updates [64]")
    of_ppo.add_argument("--hold", type=_whole, default=6, help="ticks of a decision, while it learns [6]")
    of_ppo.add_argument("--epochs", type=_whole, default=4, help="of an update [4]")
    of_ppo.add_argument("--discount", type=float, default=0.98, help="[0.98]")
    of_ppo.add_argument("--learning-rate", type=float, default=1e-3, help="[0.001], which falls to 0")
    how = parser.parse_args(arguments)
    if how.method == "cem" and how.policy != "local":
        parser.error(f"--policy {how.policy}: --method cem searches local policies; use --method ppo")
    if how.hidden is None:
        how.hidden = (4,) if how.method == "cem" else (16,)
    try:
        from . import training
    except ImportError as error:
        raise ValueError(f"{error}; it needs the package's extra: pip install 'smartsurf[learning]'") from error
    name, make = training.find_task(how.task)
    folder = how.out or pathlib.Path("out/train") / f"{name}-{how.method}"
    train = training.train_cem if how.method == "cem" else training.train_ppo
    train(make, how, folder, f"{name}: learned by smartsurf train --method {how.method}.")
    print(f"wrote {', '.join(str(path) for path in sorted(folder.iterdir()) if path.suffix in ('.aps', '.onnx', '.csv'))}")


def _whole(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} must be a whole number, at least 1")
    return int(text)


def _sizes(text: str) -> tuple[int, ...]:
    return () if text == "0" else tuple(_whole(part) for part in text.split(","))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as failed:
        print(f"smartsurf train: {failed}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
