"""What the benchmarks in Python share of MuJoCo."""
import itertools
import sys
import time


def has_mujoco(program):
    """False, with the reason on standard error, where MuJoCo is missing or is the version whose sparse factor is wrong."""
    try:
        import mujoco
    except (ImportError, OSError) as error:
        print(f"{program}: MuJoCo is left out: {error}", file=sys.stderr)
        return False
    if mujoco.__version__ == "4.0.0":
        print(f"{program}: MuJoCo is left out: 4.0.0's sparse factor is wrong (scripts/setup --python)", file=sys.stderr)
        return False
    return True


def fastest(make_step, warm_up, calls):
    """The solver and the friction cone whose steps take the least processor time after a warm-up; make_step(solver, cone)
    returns the function that makes a step."""
    def trial(options):
        step = make_step(*options)
        for _ in range(warm_up):
            step()
        start = time.process_time()
        for _ in range(calls):
            step()
        return time.process_time() - start
    return min(itertools.product(("Newton", "CG"), ("pyramidal", "elliptic")), key=trial)
