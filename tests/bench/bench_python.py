#!/usr/bin/env python3
"""Environment steps a second: VectorEnv beside MuJoCo's batched rollout and single environments in processes of their own.

  bench_python.py [--json] [--seconds S] [--cases 8x8:1,…] [--who WHO,…] [--threads N,…]

n×n pins follow a wave under k spheres, and every pin senses upwards. A step is a control period of 1/60 s: four physics
steps, or one for MuJoCo where its row says so, and one sweep of the sensors. MuJoCo has a mocap box for each pin, and its
proximity is computed in NumPy for all worlds at once, because a rangefinder per pin would search all geoms in each physics
step. It takes whichever of its solvers Newton and CG and of its cones, pyramidal and elliptic, is fastest in a trial. The
processor time that a step takes outside the compiled part is Python's share. Needs the package smartsurf, Gymnasium, and
for peers mujoco and shm_protocol.

--who warp measures MuJoCo Warp (package mujoco-warp) on an NVIDIA accelerator, the same model in many worlds at once and its
steps as one CUDA graph; neither proximity nor reward is computed there. It takes CG or Newton, whichever is faster, with
pyramidal cones.

--who controller measures an APRON program that commands the wave instead, in VectorEnv and in a process beside each
simulator; the controller's share is the processor time that a step takes beyond one with the same actions from Python.
"""
import argparse
import functools
import gc
import json
import multiprocessing
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import smartsurf

from mujoco_peer import fastest, has_mujoco

CASES = [f"{n}x{n}:{k}" for n in (8, 16, 64) for k in (1, 10, 40)]
WORLDS = (1, 64, 1024)
CONTROLLED = (1, 64)
WARP_WORLDS = (1024, 8192)
RANGE, RADIUS, PHASES = 4.0, 0.8, 32
MOST_CELLS = 1024 * 4096 + 1
PEERS = ("MuJoCo", 4), ("MuJoCo, 1 step", 1)  # and physics steps a period


def experiment(n, k):
    return f"""surface {{ rows = {n}, columns = {n}, border = {{ height = 12 }}, sensors = {{ proximity {{ range = {RANGE} }} }},
  actuator = pin {{ range = {{0, 4}}, max_speed = 20, max_acceleration = 400 }} }}
for i = 0, {k - 1} do
  sphere {{ radius = {RADIUS}, position = {{ 2 + 1.7 * i % {n - 4}, 2 + 1.7 * (1.7 * i // {n - 4}) % {n - 4}, 3 + 0.4 * i }} }}
end
reward(function() local x = object(0):position() return x end)
"""


CONTROLLER = f"""!register(Hit, T)
while(1)
  Hit = near.max(surface.sense('proximity_hit'), 8)
  T = 1 + 0.25 * math.sin({2 * np.pi:.7f} * (cell.x / 8 - surface.tick / {PHASES})) + 0 * Hit
  surface.actuate('height', T)
  surface.step
endwhile
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


def started(file, n, worlds, threads):
    """The worlds, and the actions of all phases."""
    envs = smartsurf.VectorEnv(file, worlds, threads, copy=False)
    envs.reset(seed=1)
    return envs, [np.ascontiguousarray(np.broadcast_to(heights, envs.action_space.shape)) for heights in wave(n)]


def resident_mib():
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def memory_of_worlds(file, n, worlds, threads):
    before = resident_mib()
    envs, actions = started(file, n, worlds, threads)
    for heights in actions:
        envs.step(heights)
    return resident_mib() - before - sum(a.nbytes for a in actions) / 2**20


def measure_memory(*case):
    """MiB of the worlds after a wave, in a process of its own: here they would reuse what earlier cases have freed."""
    with multiprocessing.get_context("spawn").Pool(1) as fresh:
        return {"mib": fresh.apply(memory_of_worlds, case)}


def measure_vector(file, n, worlds, threads, how):
    envs, actions = started(file, n, worlds, threads)
    rate, cpu = steps_a_second(lambda i: envs.step(actions[i % PHASES]), worlds, how.seconds)
    share = python_share(envs, actions, max(1, int(0.05 * rate / worlds)))
    return {"steps_per_s": rate, "steps_per_cpu_s": cpu, "python_share": share}


def measure_controlled(file, program, n, worlds, threads, how):
    envs = smartsurf.VectorEnv(file, worlds, threads, copy=False, controller=program)
    envs.reset(seed=1)
    rate, cpu = steps_a_second(lambda i: envs.step(), worlds, how.seconds)
    free = measure_vector(file, n, worlds, threads, how)["steps_per_cpu_s"]
    return {"steps_per_s": rate, "steps_per_cpu_s": cpu, "controller_share": 1 - cpu / free}


def measure_pairs(file, program, worlds, how):
    """Simulators with the controller in a process beside each; without their start, and an episode of 10 s with it."""
    def run(ticks):
        wall, before = time.perf_counter(), os.times()
        subprocess.run([how.smartsurf, "run", file, "--controller", program, "--worlds", str(worlds), "--ticks", str(ticks)],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        after = os.times()
        return time.perf_counter() - wall, sum(after[2:4]) - sum(before[2:4])

    episode = 600
    more = int(1e5 * how.seconds) // worlds
    short, long = (np.min([run(ticks) for _ in range(3)], axis=0) for ticks in (episode, episode + more))
    wall, cpu = long - short
    return {"steps_per_s": more * worlds / wall, "steps_per_cpu_s": more * worlds / cpu, "episodes_steps_per_s": episode * worlds / short[0]}


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


def mjcf(n, k, timestep, solver, cone):
    pins = "".join(f"<body mocap='true' pos='{c} {n - 1 - r} 0'><geom type='box' size='.4 .4 1' contype='2' conaffinity='1'/></body>"
                   for r in range(n) for c in range(n))
    walls = "".join(f"<geom type='plane' size='99 99 1' pos='{x} {y} 0' zaxis='{-dx} {-dy} 0' contype='2' conaffinity='1'/>"
                    for x, y, dx, dy in ((0.5, 0, -1, 0), (n - 1.5, 0, 1, 0), (0, 0.5, 0, -1), (0, n - 1.5, 0, 1)))
    balls = "".join(f"<body pos='{2 + 1.7 * i % (n - 4)} {2 + 1.7 * (1.7 * i // (n - 4)) % (n - 4)} {4 + .4 * i}'><freejoint/>"
                    f"<geom type='sphere' size='{RADIUS}' density='1'/></body>" for i in range(k))
    return (f"<mujoco><option timestep='{timestep}' solver='{solver}' cone='{cone}'/><size memory='256M'/><worldbody>"
            f"{pins}{walls}{balls}</worldbody></mujoco>")


PATCH = np.mgrid[0:2, 0:2].reshape(2, 1, 1, -1)  # offsets of the cells under a sphere, which is narrower than two cells


def proximity(centres, heights):
    """Distance from each pin's top straight up to the nearest sphere, RANGE where there is none. centres: worlds × spheres ×
    3; heights: rows × columns, row 0 north; returns worlds × rows × columns."""
    worlds, n = len(centres), len(heights)
    x, y, z = (centres[..., None, axis] for axis in range(3))
    columns = (np.ceil(x - RADIUS) + PATCH[0]).astype(np.intp)
    ups = (np.ceil(y - RADIUS) + PATCH[1]).astype(np.intp)
    depth = RADIUS**2 - (columns - x) ** 2 - (ups - y) ** 2
    world, sphere, cell = np.nonzero((depth >= 0) & (columns >= 0) & (columns < n) & (ups >= 0) & (ups < n))
    column, row = columns[world, sphere, cell], n - 1 - ups[world, sphere, cell]
    distance = z[world, sphere, 0] - np.sqrt(depth[world, sphere, cell]) - heights[row, column]
    seen = np.full((worlds, n, n), RANGE, np.float32)
    np.minimum.at(seen, (world, row, column), np.where(distance >= 0, distance, RANGE))
    return seen


def measure_mujoco(n, k, substeps, threads, how):
    """A period is one rollout of `substeps` physics steps, the proximity of all pins, and the reward."""
    import mujoco
    from mujoco import rollout
    worlds = (32 if n < 64 else 2) * threads
    heights = wave(n)

    def stepper(roll, solver, cone):
        model = mujoco.MjModel.from_xml_string(mjcf(n, k, 1 / 60 / substeps, solver, cone))
        data = [mujoco.MjData(model) for _ in range(threads)]
        control = np.tile(model.body_pos[model.body_mocapid >= 0].reshape(1, 1, -1), (worlds, substeps, 1))
        state = np.zeros((worlds, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
        for i in range(worlds):
            mujoco.mj_getState(model, data[0], state[i], mujoco.mjtState.mjSTATE_FULLPHYSICS)

        def step(call):
            nonlocal state
            now = heights[call % PHASES]
            control[:, :, 2::3] = now.reshape(-1) - 1
            states = roll.rollout(model, data, state, control, control_spec=int(mujoco.mjtState.mjSTATE_MOCAP_POS), nstep=substeps)[0]
            state = np.ascontiguousarray(states[:, -1])
            centres = state[:, 1:1 + 7 * k].reshape(worlds, k, 7)[..., :3]  # behind the time: position and quaternion of each
            return proximity(centres, now), centres[:, 0, 0]
        return step

    with rollout.Rollout(nthread=threads) as roll:
        options = fastest(lambda *options: functools.partial(stepper(roll, *options), 0), warm_up=20, calls=10 if n < 64 else 4)
        rate, cpu = steps_a_second(stepper(roll, *options), worlds, how.seconds)
    return {"steps_per_s": rate, "steps_per_cpu_s": cpu, "options": ", ".join(options), "version": mujoco.__version__}


def measure_warp(n, k, substeps, worlds, how):
    """A period is one CUDA graph: the pins' heights, then `substeps` physics steps."""
    import mujoco
    import mujoco_warp
    import warp
    heights = warp.array(wave(n).reshape(PHASES, n * n))
    phase = warp.zeros(1, dtype=int)

    def stepper(solver):
        model = mujoco.MjModel.from_xml_string(mjcf(n, k, 1 / 60 / substeps, solver, "pyramidal"))
        started = mujoco.MjData(model)
        mujoco.mj_forward(model, started)
        # A sphere touches at most four pins and two walls, beside other spheres; a pyramid has four constraints.
        contacts = k * 8 + k * (k - 1) // 2
        many = mujoco_warp.put_model(model)
        data = mujoco_warp.put_data(model, started, nworld=worlds, nconmax=contacts, njmax=4 * contacts)

        @warp.kernel
        def follow(heights: warp.array2d(dtype=float), phase: warp.array(dtype=int), pins: warp.array2d(dtype=warp.vec3)):
            world, pin = warp.tid()
            at = pins[world, pin]
            pins[world, pin] = warp.vec3(at[0], at[1], heights[phase[0], pin] - 1.0)

        @warp.kernel
        def advance(phase: warp.array(dtype=int)):
            phase[0] = (phase[0] + 1) % PHASES

        def period():
            warp.launch(follow, dim=(worlds, n * n), inputs=[heights, phase, data.mocap_pos])
            for _ in range(substeps):
                mujoco_warp.step(many, data)
            warp.launch(advance, dim=1, inputs=[phase])

        period()  # compiles
        with warp.ScopedCapture() as capture:
            period()
        return capture.graph, data

    def rate(graph, calls):
        warp.synchronize()
        start = time.perf_counter()
        for _ in range(calls):
            warp.capture_launch(graph)
        warp.synchronize()
        return calls * worlds / (time.perf_counter() - start)

    best = {}
    for solver in ("CG", "Newton"):
        graph, data = stepper(solver)
        rate(graph, 120)  # the spheres land
        calls = max(10, int(how.seconds * rate(graph, 10) / worlds))
        height = data.qpos.numpy().reshape(worlds, k, 7)[:, :, 2]
        best[solver] = max(rate(graph, calls) for _ in range(3)), float(np.mean(height < 0)), float(height.mean())
    solver = max(best, key=lambda name: best[name][0])
    return {"steps_per_s": best[solver][0], "options": solver, "fallen": best[solver][1], "height": best[solver][2],
            "version": mujoco_warp.__version__, "device": warp.get_device().name, "solvers": {s: v[0] for s, v in best.items()}}


def measurements(how):
    with tempfile.TemporaryDirectory() as folder:
        for case in how.cases:
            size, k = case.split(":")
            n, k = int(size.split("x")[0]), int(k)
            file = str(pathlib.Path(folder) / "wave.lua")
            pathlib.Path(file).write_text(experiment(n, k))
            program = str(pathlib.Path(folder) / "wave.aps")
            pathlib.Path(program).write_text(CONTROLLER)
            name = f"{size} {k}"
            for threads in how.threads:
                about = {"case": name, "threads": threads}
                for worlds in WORLDS:
                    if "vector" in how.who and worlds * n * n < MOST_CELLS:
                        yield {"who": f"VectorEnv, {worlds}", **about, **measure_vector(file, n, worlds, threads, how),
                               **measure_memory(file, n, worlds, threads)}
                        gc.collect()
                for worlds in CONTROLLED if "controller" in how.who else ():
                    yield {"who": f"VectorEnv, {worlds}, controller", **about,
                           **measure_controlled(file, program, n, worlds, threads, how)}
                for who, substeps in PEERS if "mujoco" in how.who else ():
                    yield {"who": who, **about, **measure_mujoco(n, k, substeps, threads, how)}
            for worlds in WARP_WORLDS if "warp" in how.who else ():
                for who, substeps in PEERS:
                    yield {"who": f"{who.replace('MuJoCo', 'MuJoCo Warp')}, {worlds}", "case": name,
                           **measure_warp(n, k, substeps, worlds, how)}
            if "vector" in how.who:
                yield {"who": "Simulation", "case": name, **measure_states(file, n)}
            for worlds in CONTROLLED if "controller" in how.who else ():
                yield {"who": f"pairs, {worlds}", "case": name, **measure_pairs(file, program, worlds, how)}
            if "surface" in how.who:
                yield {"who": "attach", "case": name, **measure_live_surface(file, n, how)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.add_argument("--seconds", type=float, default=0.7, help="seconds of one measurement")
    parser.add_argument("--cases", type=lambda text: text.split(","), default=CASES)
    parser.add_argument("--who", type=lambda text: text.split(","), default=["vector", "surface", "mujoco"])
    parser.add_argument("--threads", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2],
                        help="threads of VectorEnv and of MuJoCo; several give a row each")
    parser.add_argument("--smartsurf", default="smartsurf", help="the program, for single environments")
    how = parser.parse_args()
    if "mujoco" in how.who and not has_mujoco("bench_python"):
        how.who.remove("mujoco")
    try:
        __import__("shm_protocol")
    except (ImportError, OSError) as error:
        if "surface" in how.who:
            print(f"bench_python: shm_protocol is left out: {error}", file=sys.stderr)
            how.who.remove("surface")
    for line in measurements(how):
        print(json.dumps(line) if how.json else
              f"{line['case']:10} {line['who']:16} save {line['save_us']:.0f} µs, restore {line['restore_us']:.0f} µs, reset "
              f"{line['reset_us']:.0f} µs, {line['bytes']} bytes" if "save_us" in line else
              f"{line['case']:10} {line['who']:25} {line['steps_per_s']:12.0f} steps/s"
              + (f", {line['steps_per_cpu_s']:.0f} per CPU second" if "steps_per_cpu_s" in line else "")
              + (f", controller {100 * line['controller_share']:.0f} %" if "controller_share" in line else "")
              + (f", {line['episodes_steps_per_s']:.0f} in episodes of 10 s" if "episodes_steps_per_s" in line else "")
              + (f", Python {100 * line['python_share']:.0f} %, {line['mib']:.0f} MiB" if "mib" in line else ""), flush=True)


if __name__ == "__main__":
    main()
