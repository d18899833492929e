#!/usr/bin/env python3
"""Environment steps a second: VectorEnv beside MuJoCo's batched rollout and single environments in processes of their own.

  bench_python.py [--json] [--seconds S] [--cases 8x8:1,…] [--who WHO,…] [--threads N,…]

n×n pins follow a wave under k spheres, and every pin senses upwards. A step is a control period of 1/60 s: four physics
steps, or one for MuJoCo where its row says so, and one sweep of the sensors, or one in each physics step for MuJoCo's
plain rollout, which cannot leave any out. MuJoCo has a mocap box and a rangefinder for each pin. The processor time that
a step takes outside the compiled part is Python's share. Needs the package smartsurf, Gymnasium, and for peers mujoco and
shm_protocol.
"""
import argparse
import gc
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import smartsurf

CASES = [f"{n}x{n}:{k}" for n in (8, 16, 64) for k in (1, 10, 40)]
WORLDS = (1, 64, 1024)
RANGE, RADIUS, PHASES = 4.0, 0.8, 32
MOST_CELLS = 1024 * 4096 + 1
# Name, physics steps a period, and whether only the last of them senses.
PEERS = ("MuJoCo, senses once", 4, True), ("MuJoCo rollout", 4, False), ("MuJoCo, 1 step", 1, False)


def experiment(n, k):
    return f"""surface {{ rows = {n}, columns = {n}, border = {{ height = 12 }}, sensors = {{ proximity {{ range = {RANGE} }} }},
  actuator = pin {{ range = {{0, 4}}, max_speed = 20, max_acceleration = 400 }} }}
for i = 0, {k - 1} do
  sphere {{ radius = {RADIUS}, position = {{ 2 + 1.7 * i % {n - 4}, 2 + 1.7 * (1.7 * i // {n - 4}) % {n - 4}, 3 + 0.4 * i }} }}
end
reward(function() local x = object(0):position() return x end)
"""


def wave(n):
    """Targets of the pins, phases × n × n."""
    row, column = np.mgrid[0:n, 0:n]
    phase = np.arange(PHASES)[:, None, None]
    return (1 + 0.25 * np.sin(2 * np.pi * (column / 8 - phase / PHASES))).astype(np.float32)


def steps_a_second(step, per_call, seconds):
    """The best of three spells, after a warm-up that lets the spheres land; per second of wall time and of processor time."""
    start, calls = time.perf_counter(), 0
    while calls < 60 and time.perf_counter() - start < 3 * seconds:
        step(calls)
        calls += 1
    best = best_cpu = 0.0
    for _ in range(3):
        start, cpu, calls = time.perf_counter(), time.process_time(), 0
        while calls == 0 or time.perf_counter() - start < seconds:
            step(calls)
            calls += 1
        best = max(best, calls * per_call / (time.perf_counter() - start))
        best_cpu = max(best_cpu, calls * per_call / max(time.process_time() - cpu, 1e-9))
    return best, best_cpu


def python_share(envs, actions, calls):
    """The part of a step's processor time that is spent outside the compiled part; both loops the least of several."""
    least = [np.inf, np.inf]
    for _ in range(7):
        for which, step in enumerate((envs.step, envs._batch.step)):
            start = time.process_time()
            for i in range(calls):
                step(actions[i % PHASES])
            least[which] = min(least[which], time.process_time() - start)
    return max(0.0, 1 - least[1] / least[0])


def measure_vector(file, n, worlds, threads, how):
    before = resident_mib()
    envs = smartsurf.VectorEnv(file, worlds, threads, copy=False)
    envs.reset(seed=1)
    actions = [np.ascontiguousarray(np.broadcast_to(heights, envs.action_space.shape)) for heights in wave(n)]
    rate, cpu = steps_a_second(lambda i: envs.step(actions[i % PHASES]), worlds, how.seconds)
    share = python_share(envs, actions, max(1, int(0.05 * rate / worlds)))
    return {"steps_per_s": rate, "steps_per_cpu_s": cpu, "python_share": share,
            "mib": resident_mib() - before - sum(a.nbytes for a in actions) / 2**20}


def resident_mib():
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def measure_states(file, n):
    """Microseconds of processor time to save, to restore and to reset a world in motion; the least of several."""
    simulation, targets = smartsurf.Simulation(file, seed=1), wave(n)
    for tick in range(600):
        simulation.step(targets[tick % PHASES])
    if (simulation.objects["position"][:, 2] < 0).mean() > 0.5:  # an empty table would be measured
        raise SystemExit("bench_python: the wave throws spheres off the table")
    state = simulation.save()

    def least(call, calls=20):
        spells = []
        for _ in range(9):
            start = time.process_time()
            for i in range(calls):
                call(i)
            spells.append((time.process_time() - start) / calls)
        return 1e6 * min(spells)

    return {"save_us": least(lambda i: simulation.save()), "restore_us": least(lambda i: simulation.restore(state)),
            "reset_us": least(simulation.reset), "bytes": len(state)}


def measure_live_surface(file, n, how):
    name, targets = f"bench-{os.getpid()}", wave(n)
    simulator = subprocess.Popen([how.smartsurf, "run", file, "--shm", name, "--seed", "1"], stderr=subprocess.DEVNULL,
                                 env={**os.environ, "SMARTSURF_PARENT": str(os.getpid())})
    try:
        with smartsurf.attach(name) as surface:
            rate, _ = steps_a_second(lambda i: surface.step(targets[i % PHASES]), 1, how.seconds)
    finally:
        simulator.terminate()
        simulator.wait()
    return {"steps_per_s": rate}


def mjcf(n, k, timestep, senses=True):
    pins = "".join(
        f"<body mocap='true' pos='{c} {n - 1 - r} 0'><geom type='box' size='.4 .4 1' contype='2' conaffinity='1'/>"
        f"<site name='s{r}_{c}' pos='0 0 1.001' zaxis='0 0 1'/></body>" for r in range(n) for c in range(n))
    walls = "".join(f"<geom type='plane' size='99 99 1' pos='{x} {y} 0' zaxis='{-dx} {-dy} 0' contype='2' conaffinity='1'/>"
                    for x, y, dx, dy in ((0.5, 0, -1, 0), (n - 1.5, 0, 1, 0), (0, 0.5, 0, -1), (0, n - 1.5, 0, 1)))
    balls = "".join(f"<body pos='{2 + 1.7 * i % (n - 4)} {2 + 1.7 * (1.7 * i // (n - 4)) % (n - 4)} {4 + .4 * i}'><freejoint/>"
                    f"<geom type='sphere' size='{RADIUS}' density='1'/></body>" for i in range(k))
    sensors = "".join(f"<rangefinder site='s{r}_{c}' cutoff='{RANGE}'/>" for r in range(n) for c in range(n))
    flag = f"<flag sensor='{'enable' if senses else 'disable'}'/>"
    return (f"<mujoco><option timestep='{timestep}' integrator='implicitfast'>{flag}</option><size memory='256M'/><worldbody>"
            f"{pins}{walls}{balls}</worldbody><sensor>{sensors}</sensor></mujoco>")


def measure_mujoco(n, k, substeps, senses_once, threads, how):
    """senses_once: a period is two rollouts, of all physics steps but the last without sensors, and of the last."""
    import mujoco
    from mujoco import rollout
    model = mujoco.MjModel.from_xml_string(mjcf(n, k, 1 / 60 / substeps))
    blind = mujoco.MjModel.from_xml_string(mjcf(n, k, 1 / 60 / substeps, senses=False))
    # Two rollouts a period need more worlds for the calls not to count.
    worlds = (32 if senses_once and n < 64 else 2) * threads
    periods = 1 if senses_once else 8 if n < 64 else 2
    steps = periods * substeps
    data = [mujoco.MjData(model) for _ in range(threads)]
    spec = mujoco.mjtState.mjSTATE_MOCAP_POS
    control = np.tile(model.body_pos[model.body_mocapid >= 0].reshape(1, 1, -1), (worlds, steps, 1))
    heights = wave(n).reshape(PHASES, -1)
    for i in range(steps):
        control[:, i, 2::3] = heights[i // substeps % PHASES] - 1
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros((worlds, mujoco.mj_stateSize(model, full)))
    for i in range(worlds):
        mujoco.mj_getState(model, data[0], state[i], full)
    with rollout.Rollout(nthread=threads) as roll:
        def step(call):
            nonlocal state
            if senses_once:
                control[:, :, 2::3] = heights[call % PHASES] - 1
                state = roll.rollout(blind, data, state, control[:, 1:], control_spec=int(spec), nstep=steps - 1)[0][:, -1]
            last = control[:, :1] if senses_once else control
            states, sensors = roll.rollout(model, data, np.ascontiguousarray(state), last, control_spec=int(spec),
                                           nstep=last.shape[1])
            state = np.ascontiguousarray(states[:, -1])
        rate, cpu = steps_a_second(step, worlds * periods, how.seconds)
    return {"steps_per_s": rate, "steps_per_cpu_s": cpu, "version": mujoco.__version__}


def measurements(how):
    with tempfile.TemporaryDirectory() as folder:
        for case in how.cases:
            size, k = case.split(":")
            n, k = int(size.split("x")[0]), int(k)
            file = str(pathlib.Path(folder) / "wave.lua")
            pathlib.Path(file).write_text(experiment(n, k))
            name = f"{size} {k}"
            for threads in how.threads:
                on_threads = f", {threads} thread{'s' * (threads > 1)}" if len(how.threads) > 1 else ""
                for worlds in WORLDS:
                    if "vector" in how.who and worlds * n * n < MOST_CELLS:
                        yield {"who": f"VectorEnv, {worlds}{on_threads}", "case": name,
                               **measure_vector(file, n, worlds, threads, how)}
                        gc.collect()
                for who, substeps, once in PEERS if "mujoco" in how.who else ():
                    yield {"who": who + on_threads, "case": name, **measure_mujoco(n, k, substeps, once, threads, how)}
            if "vector" in how.who:
                yield {"who": "Simulation", "case": name, **measure_states(file, n)}
            if "surface" in how.who:
                yield {"who": "attach", "case": name, **measure_live_surface(file, n, how)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.add_argument("--seconds", type=float, default=0.7, help="of one spell")
    parser.add_argument("--cases", type=lambda text: text.split(","), default=CASES)
    parser.add_argument("--who", type=lambda text: text.split(","), default=["vector", "surface", "mujoco"])
    parser.add_argument("--threads", type=lambda text: [int(n) for n in text.split(",")], default=[2],
                        help="of VectorEnv and of MuJoCo; several give a row each")
    parser.add_argument("--smartsurf", default="smartsurf", help="the program, for single environments")
    how = parser.parse_args()
    for package, who in (("mujoco", "mujoco"), ("shm_protocol", "surface")):
        try:
            __import__(package)
        except (ImportError, OSError) as error:
            if who in how.who:
                print(f"bench_python: {package} is left out: {error}", file=sys.stderr)
                how.who.remove(who)
    for line in measurements(how):
        print(json.dumps(line) if how.json else
              f"{line['case']:10} {line['who']:16} save {line['save_us']:.0f} µs, restore {line['restore_us']:.0f} µs, reset "
              f"{line['reset_us']:.0f} µs, {line['bytes']} bytes" if "save_us" in line else
              f"{line['case']:10} {line['who']:20} {line['steps_per_s']:12.0f} steps/s"
              + (f", {line['steps_per_cpu_s']:.0f} per CPU second" if "steps_per_cpu_s" in line else "")
              + (f", Python {100 * line['python_share']:.0f} %, {line['mib']:.0f} MiB" if "mib" in line else ""), flush=True)


if __name__ == "__main__":
    main()
