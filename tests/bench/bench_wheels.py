#!/usr/bin/env python3
"""Boxes on a table of wheels: ours beside MuJoCo's geom/surfacevel, one box of MuJoCo's for each cell and one for all.

  bench_wheels.py [--json] [--cases 100,300] [--steps N]

64×64 cells carry k boxes of 2×2×1 u. In *swirl* each cell drives around the centre of the table; in *belt* all drive alike,
so that one geom of MuJoCo's is enough. A step is one physics step of 1/240 s, on one
thread; the figure is processor time. MuJoCo takes whichever of its solvers Newton and CG and of its cones, pyramidal and
elliptic, is fastest in a trial. Needs the package smartsurf, and mujoco for the peer.
"""
import argparse
import itertools
import json
import pathlib
import tempfile
import time

import numpy as np
import smartsurf

from mujoco_peer import fastest, has_mujoco

CELLS, STEP, SPEED, LANDING = 64, 1 / 240, 1.5, 240
RADIUS = 0.3  # of a wheel, u


def places(k):
    """Centres of the boxes, which begin in rows around the centre of the table."""
    side = int(np.ceil(np.sqrt(k)))
    spacing = min(3.5, (CELLS - 20) / side)
    middle = (CELLS - 1) / 2
    return [(middle + spacing * (i % side - (side - 1) / 2), middle + spacing * (i // side - (side - 1) / 2)) for i in range(k)]


def directions(pattern):
    """Surface velocities of the cells, east and north, rows × columns × 2, row 0 north."""
    velocity = np.zeros((CELLS, CELLS, 2), np.float32)
    if pattern == "belt":
        velocity[..., 0] = SPEED
    else:
        row, column = np.mgrid[0:CELLS, 0:CELLS]
        x, y = column - (CELLS - 1) / 2, (CELLS - 1) / 2 - row
        distance = np.hypot(x, y)
        velocity[..., 0], velocity[..., 1] = -SPEED * y / distance, SPEED * x / distance
    return velocity


def milliseconds(step, steps):
    """The least mean of three spells, after a second in which the boxes land on the cells and reach their speed."""
    for _ in range(LANDING):
        step()
    least = np.inf
    for _ in range(3):
        start = time.process_time()
        for _ in range(steps):
            step()
        least = min(least, 1e3 * (time.process_time() - start) / steps)
    return least


def measure_ours(pattern, k, steps):
    boxes = "\n".join(f"box {{ size = {{2, 2, 1}}, position = {{ {x}, {y}, 0.52 }} }}" for x, y in places(k))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "wheels.lua"
        file.write_text(f"world {{ dt = {STEP}, control_period = {STEP} }}\nmaterial {{ name = 'default', friction = 0.5 }}\nsurface {{ rows = {CELLS}, columns = {CELLS}, "
                        f"actuator = wheels {{ radius = {RADIUS} }} }}\n{boxes}\n")
        simulation = smartsurf.Simulation(str(file), seed=1)
    spin = directions(pattern) / RADIUS
    command = {"spin_a": spin[..., 0].copy(), "spin_b": spin[..., 1].copy()}
    simulation.step(command)  # wheels keep their speeds until the next command
    ms = milliseconds(simulation.step, steps)
    heights = simulation.objects["position"][:, 2]
    return {"ms": ms, "fallen": int((heights < 0).sum())}


def mjcf(pattern, k, one_belt, solver, cone):
    velocity = directions(pattern)

    def cell(x, y, half, speed):
        return (f"<geom type='box' pos='{x} {y} -0.5' size='{half} {half} .5' surfacevel='{speed[0]} {speed[1]} 0 0 0 0' "
                "contype='2' conaffinity='1' friction='.5 0 0'/>")
    if one_belt:
        floor = cell((CELLS - 1) / 2, (CELLS - 1) / 2, CELLS / 2, velocity[0, 0])
    else:
        floor = "".join(cell(column, CELLS - 1 - row, 0.5, velocity[row, column])
                        for row in range(CELLS) for column in range(CELLS))
    boxes = "".join(f"<body pos='{x} {y} 0.52'><freejoint/><geom type='box' size='1 1 .5' density='1' friction='.5 0 0'/></body>"
                    for x, y in places(k))
    return (f"<mujoco><option timestep='{STEP}' gravity='0 0 -10' solver='{solver}' cone='{cone}'/><size memory='512M'/>"
            f"<worldbody>{floor}{boxes}</worldbody></mujoco>")


def measure_mujoco(pattern, k, one_belt, steps):
    import mujoco

    def stepper(*options):
        model = mujoco.MjModel.from_xml_string(mjcf(pattern, k, one_belt, *options))
        data = mujoco.MjData(model)
        return lambda: mujoco.mj_step(model, data), data

    options = fastest(lambda *options: stepper(*options)[0], warm_up=LANDING // 2, calls=24)
    step, data = stepper(*options)
    ms = milliseconds(step, steps)
    return {"ms": ms, "fallen": int((data.xpos[1:, 2] < 0).sum()), "options": ", ".join(options), "version": mujoco.__version__}


def measurements(how):
    for pattern, k in itertools.product(("swirl", "belt"), how.cases):
        case = f"{pattern} {k}"
        yield {"who": "ours", "case": case, **measure_ours(pattern, k, how.steps)}
        if how.mujoco:
            yield {"who": "MuJoCo, a box a cell", "case": case, **measure_mujoco(pattern, k, False, how.steps)}
            if pattern == "belt":
                yield {"who": "MuJoCo, one belt", "case": case, **measure_mujoco(pattern, k, True, how.steps)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.add_argument("--cases", type=lambda text: [int(k) for k in text.split(",")], default=[100, 300], help="numbers of boxes")
    parser.add_argument("--steps", type=int, default=240, help="steps of one measurement")
    how = parser.parse_args()
    how.mujoco = has_mujoco("bench_wheels")
    for line in measurements(how):
        print(json.dumps(line) if how.json else f"{line['case']:10} {line['who']:22} {line['ms']:8.3f} ms  {line.get('options', '')}"
              f"  fallen {line['fallen']}", flush=True)


if __name__ == "__main__":
    main()
