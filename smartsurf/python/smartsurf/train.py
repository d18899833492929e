"""Learns a policy of a task; `smartsurf train TASK`, or python -m smartsurf.train TASK.

TASK is a task of docs/tasks.md (Relocate), an experiment with reward() and episode{} (plate.lua), or a smartsurf.Task
(turn.py:TurnBox). FOLDER [out/train/TASK-METHOD] receives curve.csv, by samples and processor time, the same for TensorBoard
where that is installed, and after each iteration the policy: policy.onnx, and if it is local policy.aps. Both are controllers
of `smartsurf run`, except for an mlp that sees a Task's own observation.

  cem   the cross-entropy method (Rubinstein 1999) over the parameters of a LocalPolicy. Needs NumPy and Gymnasium alone.
  ppo   proximal policy optimization (Schulman et al. 2017), after CleanRL's. Every cell's commands are an action of their own,
        with the advantage of the world; the cells of a world explore together. Needs torch.

Equal arguments give equal policies, for any number of threads.
"""
from __future__ import annotations

import argparse
import importlib.util
import os
import pathlib
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from ._arguments import Parser, non_negative, positive, share, whole
from ._printable import guard_output, printable


def main(arguments: Sequence[str] | None = None) -> None:
    """The command. arguments: without the program's name [sys.argv]."""
    parser = Parser(prog="smartsurf train", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", metavar="TASK")
    parser.add_argument("--method", choices=("cem", "ppo"), default="cem", help="learning method [cem]")
    parser.add_argument("--policy", choices=("local", "cnn", "mlp"), default="local", help="kind of policy; cem: local only [local]")
    parser.add_argument("--hidden", type=_sizes, metavar="N,…", help="units of the hidden layers, 0 for none [cem 4, ppo 16, mlp 64]")
    parser.add_argument("--iterations", type=whole(1), default=30, help="generations or updates [30]")
    parser.add_argument("--seed", type=whole(0, 2**63 - 1), default=1, help="seed of everything random [1]")
    parser.add_argument("--neighbours", type=int, choices=(0, 4, 8), help="neighbours that each cell of a local policy reads [cem 4, ppo 8]")
    parser.add_argument("--memory", type=whole(0), default=0, help="values that each cell of a local policy remembers [0]")
    parser.add_argument("--test", type=whole(0, 10**6), default=0, metavar="N",
                        help="episodes of other seeds after each iteration, which neither samples nor times count [0]")
    parser.add_argument("--threads", type=whole(1), default=len(os.sched_getaffinity(0)), help="threads that step worlds [one per core]")
    parser.add_argument("-o", "--out", type=pathlib.Path, metavar="FOLDER", help="where the policy and its curve go [out/train/TASK-METHOD]")
    parser.add_argument("--resume", action="store_true",
                        help="go on after the last iteration of FOLDER/checkpoint.npz, if there is one, with the same arguments")
    of_cem = parser.add_argument_group("cem")
    of_cem.add_argument("--candidates", type=whole(1), default=24, help="candidates in a generation [24]")
    of_cem.add_argument("--runs", type=whole(1), default=4, help="episodes of each candidate [4]")
    of_cem.add_argument("--deviation", type=positive, default=0.5, help="initial standard deviation of the parameters [0.5]")
    of_cem.add_argument("--substeps", type=whole(1), default=1, help="how often the network is applied in a tick; needs memory [1]")
    of_ppo = parser.add_argument_group("ppo")
    of_ppo.add_argument("--worlds", type=whole(1), default=32, help="worlds that are stepped at once [32]")
    of_ppo.add_argument("--hold", type=whole(1), help="ticks for which a decision holds while it learns [6, with memory 1]")
    of_ppo.add_argument("--horizon", type=whole(1), help="decisions between two updates [192 ticks]")
    of_ppo.add_argument("--discount", type=share, help="discount factor of a decision [0.9 for 6 ticks]")
    of_ppo.add_argument("--gae-lambda", type=share, help="lambda of the generalized advantage estimation [0.9 for 6 ticks]")
    of_ppo.add_argument("--epochs", type=whole(1), default=5, help="epochs of an update [5]")
    of_ppo.add_argument("--minibatches", type=whole(1), default=4, help="minibatches of an epoch [4]")
    of_ppo.add_argument("--sequence", type=whole(1), default=24, help="decisions through which gradients of memory go back [24]")
    of_ppo.add_argument("--clip", type=positive, default=0.2, help="PPO clip range [0.2]")
    of_ppo.add_argument("--entropy", type=non_negative, default=0.0, help="weight of the entropy [0]")
    of_ppo.add_argument("--learning-rate", type=positive, default=1e-2, help="initial learning rate, which falls to 0 [0.01]")
    of_ppo.add_argument("--exploration", type=positive, default=0.5, help="initial standard deviation of commands, as a share of half their range [0.5]")
    of_ppo.add_argument("--together", type=share, default=0.9,
                        help="share of its variance that the cells of a world have in common [0.9]")
    of_ppo.add_argument("--noise-ticks", type=whole(1), default=24, help="ticks for which the cells of a world explore alike [24]")
    how = parser.parse_args(arguments)
    if how.method == "cem" and how.policy != "local":
        parser.error(f"--policy {how.policy}: --method cem searches local policies; use --method ppo")
    if how.hidden is None:
        how.hidden = (4,) if how.method == "cem" else (64,) if how.policy == "mlp" else (16,)
    if how.neighbours is None:
        how.neighbours = 4 if how.method == "cem" else 8
    if how.memory and how.policy != "local":
        parser.error(f"--memory {how.memory}: a local policy alone has memory")
    if how.memory and how.hold not in (None, 1):
        parser.error(f"--hold {how.hold}: a policy with memory decides in each tick: --hold 1")
    how.hold = how.hold or (1 if how.memory else 6)
    how.horizon = how.horizon or max(1, 192 // how.hold)
    how.discount = 0.9 ** (how.hold / 6) if how.discount is None else how.discount
    how.gae_lambda = 0.9 ** (how.hold / 6) if how.gae_lambda is None else how.gae_lambda
    try:
        from . import training
    except ImportError as error:
        raise ValueError(f"{error}; it needs the package's extra 'learning' (docs/python.md)") from error
    name, make, sources = training.find_task(how.task)
    folder = how.out or pathlib.Path("out/train") / f"{name}-{how.method}"
    learn: Any = training.train_cem
    if how.method == "ppo":
        try:
            from . import _ppo
        except ImportError as error:
            raise ValueError("--method ppo needs torch: pip install torch; cem does not") from error
        learn = _ppo.train
    if how.policy != "local" and importlib.util.find_spec("onnx") is None:
        print(f"smartsurf train: --policy {how.policy}: the policy is written as ONNX alone, which needs onnx: pip install onnx; "
              "without it this training leaves no policy", file=sys.stderr, flush=True)
    log = training.Log(folder, make, how, f"{name}: learned by smartsurf train --method {how.method}.", sources)
    if log.finished:
        return
    learn(make, how, log)
    log.close()
    print(f"wrote {', '.join(str(path) for path in sorted(folder.iterdir()) if path.suffix in ('.aps', '.onnx', '.csv'))}")


def _sizes(text: str) -> tuple[int, ...]:
    if text == "0":
        return ()
    try:
        return tuple(map(whole(1), text.split(",")))
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text}: must be numbers of units from 1, separated by commas, or 0 for no hidden layer") from None


def _refusal(reason: object) -> int:
    print(f"smartsurf train: {printable(reason)}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    guard_output()
    warnings.formatwarning = lambda message, *_: f"smartsurf train: {message}\n"
    try:
        main()
    except OSError as failed:
        sys.exit(_refusal(failed if failed.filename is None else f"{failed.filename}: {failed.strerror}"))
    except ValueError as failed:
        sys.exit(_refusal(failed))
    except KeyboardInterrupt:
        sys.exit(130)
