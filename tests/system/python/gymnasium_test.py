"""Gymnasium and PettingZoo environments: their own checks, and what this package promises besides."""
import copy
import functools
import gc
import multiprocessing
import os
import pickle
import subprocess
import sys
import threading
import time
import unittest
import warnings

try:
    import gymnasium
    import numpy as np
    import pettingzoo  # noqa: F401
    import smartsurf
    from gymnasium.vector import AutoresetMode
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import CROWD, ENDINGS, NOISY, VERDICT_SCENE, VERDICTS, ExperimentTest


def sampled(space, seed):
    space.seed(seed)
    return space.sample()


class Environments(ExperimentTest):
    def test_gymnasium_accepts_every_task(self):
        from gymnasium.utils.env_checker import check_env
        for task in smartsurf.TASKS:
            with self.subTest(task=task.id), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                env = gymnasium.make(task.id)
                check_env(env.unwrapped, skip_render_check=True)
                self.assertTrue(env.unwrapped._info().keys() >= {"seed", "success"})
                self.assertTrue(env.unwrapped.simulation._description["has_reward"])
                self.assertIsNotNone(env.unwrapped.simulation._description["episode_seconds"])
                self.assertGreater(env.observation_space.shape[0], 0)

    def test_seedless_resets_differ_and_tell_their_seed(self):
        env = smartsurf.Env(self.script(CROWD))
        env.reset(seed=1)
        seeds, observations = set(), []
        for _ in range(4):
            observation, info = env.reset()
            seeds.add(info["seed"])
            observations.append(observation.tobytes())
        self.assertEqual((len(seeds), len(set(observations))), (4, 4))
        again, _ = env.reset(seed=info["seed"])
        self.assertEqual(again.tobytes(), observations[-1])

    def test_an_episode_ends_with_metrics(self):
        env, over = smartsurf.Env(self.script(CROWD)), False
        env.reset(seed=1)
        while not over:
            observation, reward, terminated, truncated, info = env.step(sampled(env.action_space, 1))
            over = terminated or truncated
        self.assertEqual(info["metrics"].keys(), {"best", "count"})
        self.assertTrue(np.isnan(info["none"]))
        self.assertEqual(info["best"], info["metrics"]["best"])

    @unittest.skipIf(os.environ.get("SMARTSURF_VIEW") != "ON", "built without the view")
    def test_render(self):
        env = smartsurf.Env(self.script(CROWD), render_mode="rgb_array", render_size=(96, 64))
        env.reset(seed=1)
        self.assertEqual(env.render().shape, (64, 96, 3))


    def test_a_live_surface_has_the_observations_of_the_simulation_in_this_process(self):
        self.assert_live_equals_simulated(CROWD)

    def test_a_live_surface_with_empty_cells_has_the_observations_of_the_simulation_in_this_process(self):
        text = CROWD.replace("surface {", "surface { mask = function(r, c) return r + c > 3 end,")
        env = smartsurf.Env(self.script(text))
        self.assertEqual(env.simulation.sensor_channels[-1].name, "occupancy")
        for occupancy in (env.reset(seed=1)[0][-1], smartsurf.VectorEnv(self.script(text)).reset(seed=1)[0][0, -1]):
            self.assertEqual(np.argwhere(occupancy == 0).tolist(), [[0, 0], [0, 1], [1, 0]])
        self.assert_live_equals_simulated(text)

    def assert_live_equals_simulated(self, text):
        path, name = self.script(text), f"gymnasium-{os.getpid()}"
        here = smartsurf.Env(path)
        expected = [here.reset(seed=3)[0]]
        simulator = subprocess.Popen([os.environ["SMARTSURF"], "run", path, "--shm", name, "--seed", "3", "--until", "0.5"])
        self.addCleanup(simulator.wait)
        self.addCleanup(simulator.kill)
        env = smartsurf.Env(shm=name, reward=lambda observation, action: observation.sum() + action[0, 0, 0],
                            done=lambda observation: observation[0, 0, 0] < 0)
        env = gymnasium.wrappers.TimeLimit(env, 20)
        self.assertEqual((env.observation_space, env.action_space), (here.observation_space, here.action_space))
        with self.assertRaisesRegex(ValueError, "cannot be reset to a seed"):
            env.reset(seed=3)
        observation, info = env.reset()
        self.assertEqual(info["tick"], 0)
        for tick in range(1, 21):
            np.testing.assert_array_equal(observation, expected[-1])
            kept = observation.copy()
            action = sampled(env.action_space, tick)
            following, reward, terminated, truncated, info = env.step(action)
            np.testing.assert_array_equal(observation, kept)  # a copy
            observation = following
            expected.append(here.step(action)[0])
            self.assertEqual((info["tick"], terminated, truncated), (tick, False, tick == 20))
            self.assertEqual(reward, float(observation.sum() + action[0, 0, 0]))
        while not terminated:
            observation, reward, terminated, truncated, info = env.step(action)
        self.assertTrue(info["surface_closed"])
        self.assertNotIn("metrics", info)
        with self.assertRaisesRegex(RuntimeError, f"^surface {name} has closed: no episode can follow"):
            env.reset()
        env.close()
        self.assertEqual(simulator.wait(20), 0)

    def test_an_environment_is_of_an_experiment_or_of_a_live_surface(self):
        for arguments, message in (({}, "either an experiment or shm"), ({"experiment": "a.lua", "shm": "b"}, "either"),
                                   ({"shm": "b", "render_mode": "human"}, "a live surface has no picture")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.Env(**arguments)

    def test_functions_of_the_task_replace_those_of_the_script(self):
        env = smartsurf.Env(self.script(CROWD), reward=lambda observation, action: 7, done=lambda observation: True)
        env.reset(seed=1)
        _, reward, terminated, truncated, info = env.step(sampled(env.action_space, 1))
        self.assertEqual((reward, terminated, truncated), (7.0, True, False))
        self.assertEqual(info["metrics"].keys(), {"best", "count"})


    def test_a_copy_of_a_failed_environment_goes_on_after_a_reset(self):
        env = smartsurf.Env(self.script(CROWD + "local bad on_reset(function() bad = random(0, 1) < 0.5 end)\n"
                                                "at(0.1, function() if bad then error('broken') end end)"))

        def fails(seed):
            env.reset(seed=seed)
            try:
                for tick in range(10):
                    env.step(sampled(env.action_space, tick))
            except smartsurf.Error as error:
                self.assertIn("broken", str(error))
                return True
            return False
        bad, good = (next(seed for seed in range(20) if fails(seed) == wanted) for wanted in (True, False))
        for copied in (lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy):
            self.assertTrue(fails(bad))
            again = copied(env)
            with self.assertRaisesRegex(smartsurf.Error, "the episode has failed: reset it"):
                again.step(sampled(env.action_space, 1))
            for one in (env, again):
                one.reset(seed=good)
                one.step(sampled(env.action_space, 1))
            self.assertEqual(env.simulation.state_hash, again.simulation.state_hash)

    def test_a_pickled_or_copied_environment_continues_with_the_same_bits(self):
        path = self.script(CROWD)
        env, cells = smartsurf.Env(path), smartsurf.parallel_env(path, block=4)
        env.reset(seed=2)
        cells.reset(seed=2)
        for tick in range(20):
            env.step(sampled(env.action_space, tick))
            cells.step({agent: cells.action_space(agent).sample() for agent in cells.agents})
        cells.simulation.restore(env.simulation.save())
        env.simulation.actuators["height"][3, 4] = 1.5
        for copied in (lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy):
            again, state = copied(env), env.simulation.save()
            self.assertEqual(again.simulation.actuators["height"][3, 4], 1.5)
            for tick in range(20):
                one, other = (e.step(sampled(env.action_space, tick)) for e in (env, again))
                np.testing.assert_array_equal(one[0], other[0])
                self.assertEqual(one[1:4], other[1:4])
                self.assertEqual(env.simulation.state_hash, again.simulation.state_hash)
            self.assertEqual(env.reset()[1]["seed"], again.reset()[1]["seed"])
            env.simulation.restore(state)
            env.simulation.actuators["height"][3, 4] = 1.5
        again = pickle.loads(pickle.dumps(cells))
        self.assertEqual(again.agents, cells.agents)
        actions = {agent: cells.action_space(agent).sample() for agent in cells.agents}
        for one, other in zip(cells.step(actions)[0].values(), again.step(actions)[0].values(), strict=True):
            np.testing.assert_array_equal(one, other)

    def test_success_is_the_verdict_on_the_episode(self):
        for name, body, success in VERDICTS:
            if "error" in body:
                continue
            path = self.script(VERDICT_SCENE + "reward(function() return 1 end)\n" + body)
            with self.subTest(name):
                env, over = smartsurf.Env(path), False
                _, info = env.reset(seed=1)
                while not over:
                    self.assertEqual(info["success"], name == "at the start")
                    *_, terminated, truncated, info = env.step(0 * sampled(env.action_space, 1))
                    over = terminated or truncated
                self.assertIs(info["success"], success)
                self.assertIs(copy.deepcopy(env).simulation.success, success)
                for mode in ("NextStep", "SameStep"):
                    envs, over = smartsurf.VectorEnv(path, 2, autoreset_mode=mode), False
                    envs.reset(seed=1)
                    while not over:
                        *_, terminated, truncated, infos = envs.step(np.zeros(envs.action_space.shape, np.float32))
                        over = (terminated | truncated).any()
                    self.assertEqual(list(infos.get("final_info", infos)["success"]), [success] * 2)

    def test_episodes_are_recorded(self):
        folder = self.folder / "episodes"
        env = smartsurf.Env(self.script(ENDINGS), record=folder)
        for seed in (1, 2):
            env.reset(seed=seed)
            over = False
            while not over:
                _, _, terminated, truncated, info = env.step(sampled(env.action_space, seed))
                over = terminated or truncated
        env.reset(seed=3)
        env.step(sampled(env.action_space, 1))
        env.close()
        env.close()
        files = sorted(path.name for path in folder.iterdir())
        self.assertEqual(files, [f"episode-00000{i}.h5" for i in (1, 2, 3)])
        for name in files:
            verified = subprocess.run([os.environ["SMARTSURF"], "replay", str(folder / name), "--verify"],
                                      capture_output=True, text=True, timeout=120)
            self.assertEqual(verified.returncode, 0, verified.stderr)
        with self.assertRaisesRegex(ValueError, "record: the process of a live surface"):
            smartsurf.Env(shm="none", record=folder, timeout=0.1)

    def test_a_spawned_process_continues_an_environment(self):
        env = smartsurf.Env(self.script(CROWD))
        env.reset(seed=2)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            there = pool.apply(state_after, (env, 10))
        self.assertEqual(there, state_after(env, 10))

    def test_arrays_are_shared_without_copies(self):
        s = smartsurf.Simulation(self.script(CROWD))
        for array in (*s.sensors.values(), *s.objects.values()):
            with self.assertRaises(ValueError):
                array[...] = 0
        position = s.objects["position"]
        before = position.copy()
        s.step()
        self.assertFalse(np.array_equal(before, position))  # follows
        envs = smartsurf.VectorEnv(self.script(CROWD), 2, 1, copy=False)
        observations, _ = envs.reset(seed=1)
        shared = np.from_dlpack(observations)
        envs.step(sampled(envs.action_space, 1))
        np.testing.assert_array_equal(shared, envs._observations)
        self.assertTrue(np.shares_memory(shared, observations))
        with self.assertRaises(ValueError):
            envs.objects["position"][...] = 0
        try:
            import torch
        except ImportError:
            return
        tensor = torch.from_dlpack(observations)
        envs.step(sampled(envs.action_space, 2))
        np.testing.assert_array_equal(tensor.numpy(), observations)


def state_after(env, ticks):
    for tick in range(ticks):
        env.step(np.full(env.action_space.shape, tick / ticks, np.float32))
    return env.simulation.state_hash


class VectorEnvironments(ExperimentTest):
    def run_vector(self, path, num_envs, threads, ticks, mode=AutoresetMode.NEXT_STEP):
        envs = smartsurf.VectorEnv(path, num_envs, threads, autoreset_mode=mode)
        trace = [envs.reset(seed=5)[0].tobytes()]
        for tick in range(ticks):
            o, r, terminated, truncated, infos = envs.step(sampled(envs.action_space, tick // 5))
            trace.append((o.tobytes(), r.tolist(), terminated.tolist(), truncated.tolist(), infos["seed"].tolist()))
        return trace

    def test_worlds_equal_single_environments(self):
        for text in (CROWD, NOISY):
            path, n = self.script(text), 3
            envs = smartsurf.VectorEnv(path, n, 2)
            observations, infos = envs.reset(seed=5)
            singles = [smartsurf.Env(path) for _ in range(n)]
            for i, env in enumerate(singles):
                np.testing.assert_array_equal(env.reset(seed=5 + i)[0], observations[i])
            self.assertEqual(infos["seed"].tolist(), [5, 6, 7])
            over = [False] * n
            resets = 0
            for tick in range(300):
                actions = sampled(envs.action_space, tick // 5)
                observations, rewards, terminated, truncated, infos = envs.step(actions)
                for i, env in enumerate(singles):
                    if over[i]:
                        o, r, te, tr = env.reset(seed=int(infos["seed"][i]))[0], 0.0, False, False
                        resets += 1
                    else:
                        o, r, te, tr, info = env.step(actions[i])
                        if te or tr:
                            self.assertEqual({name: infos["metrics"][name][i] for name in info["metrics"]}, info["metrics"])
                    np.testing.assert_array_equal(o, observations[i])
                    self.assertEqual((r, te, tr), (rewards[i], terminated[i], truncated[i]))
                    over[i] = te or tr
            self.assertTrue(resets > 0 or text is NOISY)

    def test_threads_are_not_more_than_worlds_and_small_work_stays_on_one(self):
        path = self.script(CROWD)
        gc.collect()  # the threads of earlier environments end
        before = len(os.listdir("/proc/self/task"))
        envs = smartsurf.VectorEnv(path, 1, 4)
        self.assertEqual((envs._batch.thread_count, len(os.listdir("/proc/self/task"))), (1, before))
        self.assertEqual(smartsurf.VectorEnv(path, 3, 8)._batch.thread_count, 3)
        one, two = (smartsurf.Simulation(path, seed=1, threads=n) for n in (1, 2))

        def processor_time(simulation):
            start = time.process_time()
            for tick in range(150):
                simulation.step({"height": tick % 4})
            return time.process_time() - start
        ratios = []
        while len(ratios) < 5 or (min(ratios) >= 1.2 and len(ratios) < 40):  # on a busy machine, either may take longer
            ratios.append(processor_time(two) / processor_time(one))
        self.assertLess(min(ratios), 1.2)  # a second thread that waits would double it

    def test_threads_do_not_change_the_bits(self):
        for text in (CROWD, NOISY):
            path = self.script(text)
            traces = [self.run_vector(path, 9, threads, 60) for threads in (1, 2, 4)]
            self.assertEqual(traces[0], traces[1])
            self.assertEqual(traces[0], traces[2])

    def test_same_step_autoreset_has_the_last_observation(self):
        path = self.script(CROWD)
        same = smartsurf.VectorEnv(path, 2, 1, autoreset_mode=AutoresetMode.SAME_STEP)
        following = smartsurf.VectorEnv(path, 2, 1)
        same.reset(seed=5)
        following.reset(seed=5)
        ends = 0
        for tick in range(260):
            actions = sampled(same.action_space, tick // 5)
            o, r, terminated, truncated, infos = same.step(actions)
            o2, r2, te2, tr2, infos2 = following.step(actions)
            for i in np.flatnonzero(terminated | truncated):
                ends += 1
                np.testing.assert_array_equal(infos["final_obs"][i], o2[i])
                for name in ("best", "count"):
                    self.assertEqual(infos["final_info"]["metrics"][name][i], infos2["metrics"][name][i])
                self.assertNotIn("metrics", infos)
                np.testing.assert_array_equal(o[i], smartsurf.Env(path).reset(seed=int(infos["seed"][i]))[0])
            if ends:
                break
        self.assertGreater(ends, 0)

    def assert_same_infos(self, one, other, path="infos"):
        self.assertEqual(one.keys(), other.keys(), path)
        for key, value in one.items():
            where = f"{path}['{key}']"
            if isinstance(value, dict):
                self.assert_same_infos(value, other[key], where)
            elif value.dtype == object:
                for a, b in zip(value, other[key], strict=True):
                    self.assertEqual(type(a), type(b), where)
                    np.testing.assert_array_equal(a, b, where)
            else:
                self.assertEqual(value.dtype, other[key].dtype, where)
                np.testing.assert_array_equal(value, other[key], where)

    def test_every_autoreset_mode_equals_gymnasiums_vector_of_single_environments(self):
        class Seeded(gymnasium.Wrapper):  # resets without a seed to the one that the VectorEnv has chosen
            def reset(self, *, seed=None, options=None):
                return self.env.reset(seed=self.following if seed is None else seed, options=options)
        path = self.script(ENDINGS)
        for mode in AutoresetMode:
            with self.subTest(mode=mode.value):
                envs = smartsurf.VectorEnv(path, 4, 2, autoreset_mode=mode)
                sync = gymnasium.vector.SyncVectorEnv([lambda: Seeded(smartsurf.Env(path))] * 4, autoreset_mode=mode)
                (observations, infos), (expected, sync_infos) = envs.reset(seed=5), sync.reset(seed=5)
                np.testing.assert_array_equal(observations, expected)
                self.assert_same_infos(infos, sync_infos)
                ends = nonfinite = 0
                for tick in range(150):
                    actions = sampled(envs.action_space, tick)
                    actions[tick % 4, 0, :tick % 3, 1] = (np.nan, np.inf, -np.inf)[tick // 3 % 3]
                    step = envs.step(actions)
                    nonfinite += step[4]["nonfinite_actions"].sum()
                    for i, env in enumerate(sync.envs):
                        env.following = int(step[4]["seed"][i])
                    sync_step = sync.step(actions)
                    for value, sync_value in zip(step[:4], sync_step[:4]):
                        self.assertEqual(value.dtype, sync_value.dtype)
                        np.testing.assert_array_equal(value, sync_value)
                    self.assert_same_infos(step[4], sync_step[4], f"tick {tick}: infos")
                    ended = step[2] | step[3]
                    ends += ended.sum()
                    if mode == AutoresetMode.DISABLED and ended.any():
                        seed = [100 * tick + i for i in range(4)]
                        (observations, infos), (expected, sync_infos) = (
                            v.reset(seed=seed, options={"reset_mask": ended.copy()}) for v in (envs, sync))
                        np.testing.assert_array_equal(observations, expected)
                        self.assert_same_infos(infos, sync_infos)
                self.assertGreater(ends, 12)
                self.assertGreater(nonfinite, 100)

    def test_max_episode_steps_truncates(self):
        for task in ("smartsurf/Relocate-v0", self.script(ENDINGS.replace("limit = random(0.1, 0.9)", "limit = 0.8"))):
            path = smartsurf.task_file(task) if task.startswith("smartsurf/") else task
            envs = smartsurf.VectorEnv(path, 2, 1, max_episode_steps=7)
            envs.reset(seed=1)
            ends = [envs.step(sampled(envs.action_space, tick))[3].tolist() for tick in range(15)]
            self.assertEqual([tick for tick, end in enumerate(ends) if all(end)], [6, 14])
        envs = gymnasium.make_vec("smartsurf/Relocate-v0", num_envs=2, max_episode_steps=3)
        envs.reset(seed=1)
        self.assertEqual([envs.step(envs.action_space.sample())[3].tolist() for _ in range(3)], [[False] * 2] * 2 + [[True] * 2])
        with self.assertRaisesRegex(ValueError, "max_episode_steps = 0: must be a whole number, at least 1"):
            gymnasium.make_vec("smartsurf/Relocate-v0", max_episode_steps=0)

    def test_the_next_seed_does_not_follow_from_what_the_script_draws(self):
        path = self.script(ENDINGS.replace("info {", "local drawn = random() info { drawn = function() return drawn end,"))
        envs = smartsurf.VectorEnv(path, 400, 1, max_episode_steps=1)
        drawn = envs.reset(seed=1)[1]["drawn"]
        for _ in range(2):  # ends, and begins the next episode
            infos = envs.step(sampled(envs.action_space, 1))[4]
        self.assertEqual(len(set(infos["seed"])), 400)
        for now in (infos["seed"], infos["drawn"], infos["limit"]):
            self.assertLess(abs(np.corrcoef(drawn, now)[0, 1]), 0.2)

    def test_chains_of_episodes_do_not_meet(self):
        from smartsurf import _core
        seen, seeds = set(), range(1, 1001)
        for _ in range(300):
            seeds = [_core.next_seed(seed) for seed in seeds]
            seen.update(seeds)
        self.assertEqual(len(seen), 300_000)

    def test_a_seed_determines_all_episodes_that_follow(self):
        path = self.script(ENDINGS)
        for mode in AutoresetMode:
            for first in (5, [5, 17, 9]):
                runs = []
                for _ in range(2):
                    envs = smartsurf.VectorEnv(path, 3, 1, autoreset_mode=mode)
                    envs.reset(seed=first)
                    some = envs.reset(options={"reset_mask": np.array([False, True, True])})[1]["seed"][1:].tolist()
                    runs.append([*some, *envs.reset()[1]["seed"].tolist(), *envs.reset(seed=[None, 4, None])[1]["seed"].tolist()])
                self.assertEqual(*runs)
                self.assertEqual(len(set(runs[0])), 8)
            self.assertNotEqual(*(smartsurf.VectorEnv(path, 1, 1).reset()[1]["seed"] for _ in range(2)))

    def test_worlds_restored_to_one_state_go_on_with_episodes_of_their_own(self):
        for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            envs = smartsurf.VectorEnv(self.script(ENDINGS), 4, 1, autoreset_mode=mode)
            envs.reset(seed=1)
            state = envs.save(2)
            for world in range(4):
                envs.restore(world, state)
            there = pickle.loads(pickle.dumps(envs))
            for tick in range(33):
                seeds = [one.step(sampled(envs.action_space, tick))[4]["seed"].tolist() for one in (envs, there)]
                self.assertEqual(*seeds)
                if tick == 0:
                    self.assertEqual(seeds[0], [3] * 4)
            self.assertEqual(len(set(seeds[0])), 4)

    def test_numbers_beyond_floats_are_infinite_actions_in_one_world_and_in_many(self):
        path = self.script(ENDINGS)
        for env in (smartsurf.Env(path), smartsurf.VectorEnv(path, 2, 1)):
            env.reset(seed=1)
            with np.errstate(over="ignore"):
                self.assertEqual(np.max(env.step(np.full(env.action_space.shape, 1e300))[4]["nonfinite_actions"]), 16)
        strict = smartsurf.Env(path, strict=True)
        strict.reset(seed=1)
        with np.errstate(over="ignore"), self.assertRaisesRegex(ValueError, "must be finite"):
            strict.step(np.full(strict.action_space.shape, 1e300))

    def test_nothing_is_ignored(self):
        path = self.script(ENDINGS)
        for env in (smartsurf.Env(path), smartsurf.VectorEnv(path, 2, 1)):
            env.reset(seed=1, options={})
            with self.assertRaisesRegex(ValueError, r"options\['mask'\]: no such option of reset\(\); known: (none|reset_mask)$"):
                env.reset(seed=1, options={"mask": 1})
            with self.assertRaisesRegex(ValueError, r"options = 3: must be a dict"):
                env.reset(options=3)
        with self.assertWarnsRegex(UserWarning, "has no options"):
            smartsurf.parallel_env(path).reset(options={"a": 1})
        for make in (lambda **a: smartsurf.Env(path, **a), lambda **a: smartsurf.VectorEnv(path, 2, **a),
                     lambda **a: smartsurf.parallel_env(path, **a), lambda **a: gymnasium.make("smartsurf/Relocate-v0", **a),
                     lambda **a: gymnasium.make_vec("smartsurf/Relocate-v0", **a)):
            with self.assertRaisesRegex(TypeError, "unexpected keyword argument '?thread'?"):
                make(thread=2)

    def test_actions_that_are_not_finite_are_counted_or_refused(self):
        path = self.script(ENDINGS)
        for value in (np.nan, np.inf, -np.inf):
            for env in (smartsurf.Env(path), smartsurf.Env(path, strict=True), smartsurf.VectorEnv(path, 2, 1, strict=True)):
                env.reset(seed=1)
                action = sampled(env.action_space, 1)
                env.step(action)
                action[..., 2, 1] = value
                if env._strict:
                    with self.assertRaisesRegex(ValueError, rf"^the a[^\n]* is {value} at \[(0, )+2, 1\]: must be finite with strict=True$"):
                        env.step(action)
                    action[..., 2, 1] = 1
                    env.step(action)
                else:
                    self.assertEqual(env.step(action)[4]["nonfinite_actions"], 1)
            agents = smartsurf.parallel_env(path, block=4)
            agents.reset(seed=1)
            infos = agents.step({"block_0_0": np.full((1, 4, 4), value, np.float32)})[4]
            self.assertEqual(infos["block_0_0"]["nonfinite_actions"], 16)

    def test_restore_refreshes_info(self):
        envs = smartsurf.VectorEnv(self.script(CROWD), 2, 1, copy=False)
        envs.reset(seed=1)
        state = envs.save(0)
        _, first = envs.reset(seed=1)
        expected = {name: np.copy(first[name][0]) for name in ("seed", "success", "first", "best")}
        for tick in range(30):
            *_, infos = envs.step(sampled(envs.action_space, tick))
        self.assertNotEqual(infos["best"][0], expected["best"])
        for world in range(2):
            envs.restore(world, state)
            for name, value in expected.items():
                np.testing.assert_array_equal(infos[name][world], value)

    def test_disabled_autoreset_with_a_mask(self):
        envs = smartsurf.VectorEnv(self.script(CROWD), 3, 1, autoreset_mode=AutoresetMode.DISABLED)
        first, _ = envs.reset(seed=1)
        envs.step(sampled(envs.action_space, 1))
        mask = np.array([False, True, False])
        observations, infos = envs.reset(seed=1, options={"reset_mask": mask})
        np.testing.assert_array_equal(observations[1], first[1])
        self.assertFalse(np.array_equal(observations[0], first[0]))

    def test_gymnasiums_wrappers_and_make_vec(self):
        envs = gymnasium.make_vec("smartsurf/Relocate-v0", num_envs=3)
        self.assertIsInstance(envs.unwrapped, smartsurf.VectorEnv)
        envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
        o, _ = envs.reset(seed=1)
        self.assertIn(o, envs.observation_space)
        o, r, te, tr, infos = envs.step(envs.action_space.sample())
        self.assertEqual((o.shape, r.shape, te.dtype, tr.dtype), (envs.observation_space.shape, (3,), np.bool_, np.bool_))
        plain = gymnasium.make_vec("smartsurf/Relocate-v0", num_envs=3, vectorization_mode="sync")
        o2, _ = plain.reset(seed=1)
        np.testing.assert_array_equal(o2, envs.reset(seed=1)[0])

    def test_a_state_of_one_world_continues_in_the_others(self):
        envs = smartsurf.VectorEnv(self.script(CROWD), 3, 2)
        envs.reset(seed=1)
        for tick in range(20):
            envs.step(sampled(envs.action_space, tick))
        state = envs.save(1)
        for world in range(3):
            observation = envs.restore(world, state)
        np.testing.assert_array_equal(observation, envs._observations[1])
        action = np.broadcast_to(sampled(envs.single_action_space, 1), envs.action_space.shape)
        for _ in range(20):
            observations, rewards, *_, infos = envs.step(action)
        self.assertEqual(len({envs.state_hash(i) for i in range(3)}), 1)
        self.assertEqual((infos["seed"].tolist(), len(set(rewards))), ([2, 2, 2], 1))

    def test_a_forked_child_goes_on(self):
        envs = smartsurf.VectorEnv(self.script(CROWD), 8, 2)
        envs.reset(seed=1)
        envs.step(sampled(envs.action_space, 1))
        reading, writing = os.pipe()
        pid = os.fork()
        if pid == 0:
            envs.step(sampled(envs.action_space, 2))
            os.write(writing, b"%d" % envs.state_hash(7))
            os._exit(0)
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), 0)
        envs.step(sampled(envs.action_space, 2))
        self.assertEqual(int(os.read(reading, 100)), envs.state_hash(7))
        os.close(reading), os.close(writing)

    def test_errors_name_the_world(self):
        path = self.script(CROWD.replace("on_tick(function(t)", "on_tick(function(t) assert(t < 0.1, 'late')"))
        envs = smartsurf.VectorEnv(path, 3, 2)
        envs.reset(seed=1)
        with self.assertRaisesRegex(smartsurf.Error, "world 0: .*experiment.lua:.*late"):
            for _ in range(10):
                envs.step(sampled(envs.action_space, 1))
        envs.reset(seed=1)
        envs.step(sampled(envs.action_space, 1))
        with self.assertRaisesRegex(ValueError, "the actions have shape"):
            envs.step(np.zeros((3, 16, 16)))
        for arguments, message in (({"num_envs": 0}, "num_envs = 0"), ({"num_envs": 1.5}, "num_envs = 1.5"),
                                   ({"threads": 0}, "threads = 0"), ({"set": "n=1"}, "set = 'n=1'")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.VectorEnv(path, **arguments)
        for call, message in ((lambda: envs.reset(seed=1.5), "seed = 1.5: must be"), (lambda: envs.save("0"), "world = '0'"),
                              (lambda: envs.restore(0, None), "a NoneType is not a saved state")):
            with self.assertRaisesRegex(ValueError, message):
                call()
        for threads, message in ((0, "threads = 0: must be"), (10**9, "threads = 1000000000: must be at most 1024")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.VectorEnv(path, 1, threads)

    def test_a_world_that_fails_comes_back_and_leaves_the_others_alone(self):
        # In each fourth episode the script fails at 0.1 s, in each eighth it cannot start.
        fail = "on_tick(function(t) if fails and t > 0.1 then error('late') end end)"
        start = "on_reset(function() local n = math.random(8) fails = n < 3 if n == 8 then error('early') end"
        healthy = ENDINGS.replace("on_reset(function()", "on_reset(function() math.random(8)")
        path = self.script(healthy)
        failing = self.script(ENDINGS.replace("on_reset(function()", "local fails = false " + fail + start), "failing.lua")
        seed = next(s for s in range(1000) if not any(self.fails_to_start(failing, s + i) for i in range(6)))
        for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            with self.subTest(mode=mode.value):
                envs = smartsurf.VectorEnv(failing, 6, 2, seed=seed, autoreset_mode=mode)
                singles = [smartsurf.Env(path) for _ in range(6)]
                _, infos = envs.reset(seed=seed)
                now = infos["seed"].tolist()
                for i, env in enumerate(singles):
                    env.reset(seed=now[i])
                over, broken, errors, steps = [False] * 6, np.zeros(6, bool), [], 0
                for tick in range(300):
                    actions = sampled(envs.action_space, tick)
                    observations, rewards, terminated, truncated, infos = envs.step(actions)
                    self.assertTrue(np.isfinite(observations).all())
                    final = infos["final_info"] if mode == AutoresetMode.SAME_STEP and "final_info" in infos else infos
                    failed = final.get("_error", np.zeros(6, bool))
                    np.testing.assert_array_equal(np.isnan(rewards), failed)
                    errors += [final["error"][i] for i in np.flatnonzero(failed)]
                    self.assertTrue(truncated[failed].all() and not terminated[failed].any())
                    self.assertTrue(failed[broken].all())  # those that have not started
                    for i, env in enumerate(singles):
                        if failed[i]:
                            self.assertTrue(np.isnan(final["limit"][i]))
                        elif over[i] and mode == AutoresetMode.NEXT_STEP:  # a reset
                            np.testing.assert_array_equal(env.reset(seed=int(infos["seed"][i]))[0], observations[i])
                            self.assertEqual(rewards[i], 0)
                        else:
                            o, r, te, tr, _ = env.step(actions[i])
                            self.assertEqual((r, te, tr), (rewards[i], terminated[i], truncated[i]))
                            steps += 1
                            if mode == AutoresetMode.NEXT_STEP or not (te or tr):
                                np.testing.assert_array_equal(o, observations[i])
                        over[i] = terminated[i] or truncated[i]
                        if over[i] and mode == AutoresetMode.SAME_STEP:
                            broken[i] = self.fails_to_start(failing, int(infos["seed"][i]))
                            self.assertEqual("error" in infos and infos["_error"][i], broken[i])
                            if not broken[i]:
                                np.testing.assert_array_equal(env.reset(seed=int(infos["seed"][i]))[0], observations[i])
                        else:
                            broken[i] = False
                self.assertEqual({error.split(": ")[-1] for error in errors}, {"early", "late"})
                self.assertGreater(steps, 1000)
        strict = smartsurf.VectorEnv(failing, 6, 2, seed=seed, strict=True)
        strict.reset(seed=seed)
        with self.assertRaisesRegex(smartsurf.Error, r"^world \d: .*failing.lua:\d+:.*(late|early)"):
            for tick in range(300):
                strict.step(sampled(strict.action_space, tick))

    def test_a_world_whose_reward_or_success_fails_waits_for_its_reset(self):
        base = "surface { rows = 2, columns = 2, actuator = pin {} }\nlocal bad\non_reset(function() bad = random() < 0.5 end)\n"
        for line in ("reward(function(t) assert(not (bad and t > 0.1), 'broken') return 1 end)",
                     "success(function(t) assert(not (bad and t > 0.1), 'broken') end)"):
            with self.subTest(line):
                envs = smartsurf.VectorEnv(self.script(base + line), 6, 1, autoreset_mode=AutoresetMode.DISABLED)
                envs.reset(seed=1)
                failed, actions = np.zeros(6, bool), np.zeros(envs.action_space.shape, np.float32)
                for _ in range(12):
                    _, rewards, _, truncated, infos = envs.step(actions)
                    self.assertFalse((failed & ~np.isnan(rewards)).any())  # a failed one does not run on
                    for i in np.flatnonzero(failed):
                        self.assertIn("the episode has failed: reset it", infos["error"][i])
                        with self.assertRaisesRegex(smartsurf.Error, "reset it"):
                            envs.save(int(i))
                    failed |= np.isnan(rewards)
                self.assertTrue(0 < failed.sum() < 6, failed)
                envs.reset(options={"reset_mask": failed})
                self.assertTrue(np.isfinite(envs.step(actions)[1]).all())

    def test_a_failed_world_that_was_restored_is_copied_with_its_state(self):
        fail = "local fails = false on_tick(function(t) if fails and t > 0.1 then error('late') end end)"
        path = self.script(ENDINGS.replace("on_reset(function()", fail + "on_reset(function() fails = math.random(8) < 3"))
        envs = smartsurf.VectorEnv(path, 6, 1, seed=0, autoreset_mode=AutoresetMode.DISABLED)
        envs.reset(seed=0)
        states, failed = [envs.save(i) for i in range(6)], np.zeros(6, bool)
        for tick in range(20):
            failed |= np.isnan(envs.step(sampled(envs.action_space, tick))[1])
            if failed.any():
                break
        self.assertTrue(0 < failed.sum() < 6, failed)
        broken, sound = np.flatnonzero(failed)[0], np.flatnonzero(~failed)[0]
        pickle.loads(pickle.dumps(envs))
        envs.restore(broken, states[sound])
        other = pickle.loads(pickle.dumps(envs))
        self.assertEqual(envs.state_hash(broken), other.state_hash(broken))
        envs.objects
        envs.teleport(position=(1, 1, 7), worlds=[int(broken)])
        self.assertTrue((envs.objects["position"][broken, 0] == (1, 1, 7)).all())

    def test_a_world_that_cannot_start_fails_in_its_first_step(self):
        start = "on_reset(function() if math.random(3) == 1 then error('early') end"
        path = self.script(ENDINGS.replace("on_reset(function()", start))
        bad = np.array([self.fails_to_start(path, s) for s in range(40)])
        self.assertTrue(0 < bad[:8].sum() < 8)
        for mode in AutoresetMode:
            with self.subTest(mode=mode.value):
                envs = smartsurf.VectorEnv(path, 8, 2, seed=0, autoreset_mode=mode)
                for first, mask in ((0, None), (8, None), (16, np.arange(8) > 3)):
                    chosen = np.ones(8, bool) if mask is None else mask
                    envs.reset(seed=first)
                    _, infos = envs.reset(seed=first + 8, options=None if mask is None else {"reset_mask": mask})
                    expected = np.where(chosen, bad[first + 8:first + 16], False)
                    np.testing.assert_array_equal(infos.get("_error", np.zeros(8, bool)), expected)
                    self.assertTrue(all("early" in infos["error"][i] for i in np.flatnonzero(expected)))
                    for i in np.flatnonzero(chosen & ~expected):
                        self.assertEqual(envs.state_hash(i), smartsurf.Simulation(path, seed=first + 8 + int(i)).state_hash)
                    before = np.where(chosen, False, bad[first:first + 8])  # which still have to report it
                    _, rewards, _, truncated, infos = envs.step(sampled(envs.action_space, 1))
                    final = infos.get("final_info", infos)
                    np.testing.assert_array_equal(np.isnan(rewards), expected | before)
                    self.assertTrue(truncated[expected].all())
                    self.assertTrue(all("early" in final["error"][i] for i in np.flatnonzero(expected)))
                copied = copy.deepcopy(envs)
                for tick in range(30):
                    (*one, _), (*two, _) = (e.step(sampled(envs.action_space, tick)) for e in (envs, copied))
                    if mode != AutoresetMode.DISABLED:
                        np.testing.assert_array_equal(one[1], two[1])
                self.assertTrue(np.isfinite(rewards).any())
        with self.assertRaisesRegex(smartsurf.Error, "world 0: .*early"):
            smartsurf.VectorEnv(path, 1, seed=int(np.flatnonzero(bad)[0]))
        strict = smartsurf.VectorEnv(path, 8, seed=0, strict=True)
        with self.assertRaisesRegex(smartsurf.Error, f"world {np.flatnonzero(bad[:8])[0]}: .*early"):
            strict.reset(seed=0)

    def test_an_episode_keeps_its_result_if_the_next_cannot_start(self):
        ends = "episode { seconds = 2 / 60 }\nreward(function() return 1 end)\non_finish(function() metric('m', 7) end)\n"
        path = self.script("surface { rows = 2, columns = 2, actuator = pin {} }\n" + ends +
                           "on_reset(function() assert(random() < 0.6, 'early') end)\n")

        class Ends(smartsurf.Task):
            script = path
        for make in (functools.partial(smartsurf.VectorEnv, path), Ends().make_vec):
            envs = make(12, autoreset_mode=AutoresetMode.SAME_STEP)
            actions, none = np.zeros(envs.action_space.shape, np.float32), np.zeros(12, bool)
            _, infos = envs.reset(seed=0)
            bad, age, ends = infos["_error"], np.zeros(12), 0
            for tick in range(12):
                _, rewards, terminated, truncated, infos = envs.step(actions)
                age += 1
                over = bad | (age == 2)
                np.testing.assert_array_equal(np.isnan(rewards), bad)
                np.testing.assert_array_equal(truncated, over)
                if over.any():
                    final, whole = infos["final_info"], over & ~bad
                    self.assertTrue((rewards[whole] == 1).all())
                    self.assertTrue(not whole.any() or (final["metrics"]["m"][whole] == 7).all())
                    np.testing.assert_array_equal(final.get("_error", none), bad)
                    bad, age[over] = none.copy(), 0
                    bad[over] = [self.fails_to_start(path, int(seed)) for seed in infos["seed"][over]]
                    np.testing.assert_array_equal(infos.get("_error", none), bad)
                    ends += (whole & bad).sum()
            self.assertGreater(ends, 5)

    def test_worlds_of_a_new_environment_that_cannot_start_wait_for_a_reset(self):
        on_reset = "on_reset(function() if math.random(3) == 1 then error('early') end"
        top = "if math.random(3) == 1 then error('early') end\n"
        for text in (ENDINGS.replace("on_reset(function()", on_reset), top + ENDINGS):
            path = self.script(text)
            bad = np.array([self.fails_to_start(path, s) for s in range(200)])
            first = next(s for s in range(100) if bad[s] and not bad[s:s + 4].all())
            for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
                with self.subTest(text=text[:20], mode=mode.value):
                    envs = smartsurf.VectorEnv(path, 4, 1, seed=first, autoreset_mode=mode)
                    copied = copy.deepcopy(envs)
                    for tick in range(40):
                        (*one, infos), (*two, _) = (e.step(sampled(envs.action_space, tick)) for e in (envs, copied))
                        for a, b in zip(one, two):
                            np.testing.assert_array_equal(a, b)
                        if tick == 0:
                            np.testing.assert_array_equal(np.isnan(one[1]), bad[first:first + 4])
                            self.assertIn("early", infos.get("final_info", infos)["error"][0])
                    good = np.flatnonzero(~bad)[:4].tolist()
                    envs.reset(seed=good)
                    self.assertEqual([envs.state_hash(i) for i in range(4)],
                                     [smartsurf.Simulation(path, seed=s).state_hash for s in good])
                    state = envs.save(1)
                    there = pickle.loads(pickle.dumps(envs))
                    self.assertEqual(there.state_hash(1), envs.state_hash(1))
                    fresh = smartsurf.VectorEnv(path, 4, 1, seed=first, autoreset_mode=mode)
                    fresh.restore(0, state)  # in a world that has never started
                    self.assertEqual(fresh.state_hash(0), envs.state_hash(1))
            alone = int(np.flatnonzero(bad)[0])
            with self.assertRaisesRegex(smartsurf.Error, "^world 0: .*early"):
                smartsurf.VectorEnv(path, 1, seed=alone)
        with self.assertRaisesRegex(smartsurf.Error, "^world 2: .*no option 'size'"):
            smartsurf.VectorEnv(path, 3, seed=[alone, *good[:2]], set=[{}, {}, {"size": 2}])

    def test_a_seed_with_another_surface_is_refused(self):
        surfaces = ("local n = random() < 0.5 and 4 or 40\nsurface { rows = n, columns = n, actuator = pin { range = {0, 4} }, "
                    "sensors = { proximity { range = 4 } } }",
                    "local more = random() < 0.5 and proximity { range = 4 } or colour { range = 4 }\n"
                    "surface { rows = 4, columns = 4, actuator = pin { range = {0, 4} }, sensors = { more } }",
                    "surface { rows = 4, columns = 4, actuator = pin { range = {0, 4} } }\n"
                    "if random() < 0.5 then info { a = function() return 1 end } else info { b = function() return 1 end } end")
        for script in surfaces:
            path = self.script(script)

            def declared(seed):
                s = smartsurf.Simulation(path, seed=seed)
                return s.rows, [c.name for c in s.sensor_channels], list(s.info)
            other = next(s for s in range(1, 100) if declared(s) != declared(0))
            same = next(s for s in range(1, 100) if declared(s) == declared(0))
            simulation, envs = smartsurf.Simulation(path, seed=0), smartsurf.VectorEnv(path, 2, seed=[0, 0])
            refused = f"with seed {other}, the script declares another surface, other channels or another info{{}}"
            simulation.step()
            state, kept = simulation.save(), simulation.state_hash
            with self.assertRaisesRegex(smartsurf.Error, refused):
                simulation.reset(other)
            with self.assertRaisesRegex(smartsurf.Error, "the episode has failed: reset it"):
                simulation.step()
            simulation.restore(state)
            self.assertEqual(simulation.state_hash, kept)
            simulation.reset(same)
            simulation.step()
            _, infos = envs.reset(seed=[same, other])
            self.assertRegex(infos["error"][1], refused)
            envs.step(np.zeros(envs.action_space.shape))
            envs.reset(seed=[0, same])
            self.assertEqual(envs.state_hash(1), smartsurf.Simulation(path, seed=same).state_hash)

    def test_worlds_have_the_same_surface_channels_and_info(self):
        cases = (("surface { rows = 2 * k, columns = 4 / k, actuator = pin {}, sensors = { pressure {} } }",
                  "rows × columns are 4 × 2, not 2 × 4"),
                 ("surface { rows = 2, columns = 2, actuator = pin {}, sensors = { k == 1 and pressure {} or pressure { name = 'p' } } }",
                  "the sensor channels are p, not pressure"),
                 ("surface { rows = 2, columns = 2, actuator = k == 1 and pin {} or wheels { radius = 0.5 } }",
                  "the actuator channels are .*, not height"),
                 ("surface { rows = 2, columns = 2, actuator = pin {} }\nlocal one = function() return 1 end\n"
                  "info(k == 1 and { x = one } or { y = one })", r"the fields of info\{\} are y, not x"))
        for text, message in cases:
            by_option = self.script("local k = option('k', 1)\n" + text)
            by_seed = self.script("local k = random() < 0.5 and 1 or 2\n" + text, "drawn.lua")
            with self.subTest(text=text):
                with self.assertRaisesRegex(smartsurf.Error, "^world 2: .*experiment.lua: with seed 3, " + message + " as in world 0"):
                    smartsurf.VectorEnv(by_option, 3, 1, seed=1, set=[{}, {}, {"k": 2}])
                smartsurf.VectorEnv(by_option, 2, 1, set={"k": 2})
                first, other = (next(s for s in range(100) if self.draws(s) == k) for k in (1, 2))
                with self.assertRaisesRegex(smartsurf.Error, f"^world 1: .*drawn.lua: with seed {other}, " + message):
                    smartsurf.VectorEnv(by_seed, 2, 1, seed=[first, other])
                envs = smartsurf.VectorEnv(by_seed, 2, 1, seed=[first, first])
                _, infos = envs.reset(seed=[first, other])
                self.assertRegex(infos["error"][1], f"with seed {other}, .*" + message)

    def draws(self, seed):
        """1 or 2, as a script draws with the seed."""
        path = self.script("local k = random() < 0.5 and 1 or 2\nsurface { rows = k, columns = 1, actuator = pin {} }", "one.lua")
        return smartsurf.Simulation(path, seed=seed).rows

    def test_a_copy_after_a_reset_between_two_episodes_continues_with_the_same_bits(self):
        envs = smartsurf.VectorEnv(self.script(ENDINGS), 3, 1, max_episode_steps=4)
        envs.reset(seed=1)
        for tick in range(4):
            envs.step(sampled(envs.action_space, tick))
        envs.reset()
        copied = copy.deepcopy(envs)
        for tick in range(10):
            a, b = (one.step(sampled(envs.action_space, tick)) for one in (envs, copied))
            np.testing.assert_array_equal(a[0], b[0])
            np.testing.assert_array_equal(a[3], b[3])

    def fails_to_start(self, path, seed):
        try:
            smartsurf.Simulation(path, seed=seed)
        except smartsurf.Error:
            return True
        return False

    def test_actions_of_other_types_are_converted(self):
        path, traces = self.script(CROWD), []
        for convert in (np.asarray, np.ndarray.tolist, np.asfortranarray, lambda a: a.astype(np.float64)):
            envs = smartsurf.VectorEnv(path, 2, 1)
            envs.reset(seed=1)
            for tick in range(10):
                envs.step(convert(sampled(envs.action_space, tick)))
            traces.append([envs.state_hash(i) for i in range(2)])
        self.assertEqual(traces, [traces[0]] * 4)

    def test_actions_that_are_no_real_numbers_are_refused(self):
        path = self.script(CROWD)
        envs, env, agents = smartsurf.VectorEnv(path, 2, 1), smartsurf.Env(path), smartsurf.parallel_env(path, block=8)
        for one in (envs, env, agents):
            one.reset(seed=1)
        before = env.simulation.actuators["height"].copy()
        for bad, what in ((1j, "complex"), (b"1", "S1"), (None, "object"), ("1", "U1")):
            def filled(shape):
                return np.full(shape, bad)
            for call in (lambda: envs.step(filled(envs.action_space.shape)), lambda: env.step(filled(env.action_space.shape)),
                         lambda: agents.step({"block_0_1": filled((1, 8, 8))}), lambda: env.simulation.step(filled((16, 16)))):
                with self.assertRaisesRegex(ValueError, f"^[^\n]* has values of type [<|]?{what}[^\n]*: must be real numbers$"):
                    call()
        with self.assertRaisesRegex(ValueError, r"^the action has shape \(16, 16\): must be \(1, 16, 16\)$"):
            env.step(np.zeros((16, 16)))
        with self.assertRaisesRegex(ValueError, "^the array of actions has rows of different lengths: must be an array$"):
            envs.step([[1, 2], [3]])
        np.testing.assert_array_equal(env.simulation.actuators["height"], before)

    def test_without_copies_the_arrays_are_the_same_ones(self):
        path = self.script(CROWD)
        live, copies = (smartsurf.VectorEnv(path, 2, 1, copy=copy) for copy in (False, True))
        live.reset(seed=1), copies.reset(seed=1)
        first = live.step(sampled(live.action_space, 0))
        copies.step(sampled(live.action_space, 0))
        for tick in range(1, 300):
            action = sampled(live.action_space, tick // 5)
            one, other = live.step(action), copies.step(action)
            for a, b in zip(one[:4], other[:4]):
                np.testing.assert_array_equal(a, b)
            self.assertEqual(one[4].keys(), other[4].keys())
            for name in ("seed", "success", "first", "best"):
                np.testing.assert_array_equal(one[4][name], other[4][name])
        self.assertIs(one[0], first[0])
        self.assertIs(one[1], first[1])
        self.assertIs(one[4]["best"], first[4]["best"])
        self.assertIsNot(other[1], copies.step(action)[1])

    def test_two_threads_at_once_are_refused(self):
        envs = smartsurf.VectorEnv(self.script(CROWD), 8, 1, copy=False)
        envs.reset(seed=1)
        actions, refused = sampled(envs.action_space, 0), []

        def step():
            while not refused:
                try:
                    envs.step(actions)
                except RuntimeError as error:
                    refused.append(str(error))

        def read():
            while not refused:
                try:
                    envs.state_hash(0)
                except RuntimeError as error:
                    refused.append(str(error))
        for works in ((step, step), (step, read)):
            refused.clear()
            others = [threading.Thread(target=work) for work in works]
            for thread in others:
                thread.start()
            for thread in others:
                thread.join(timeout=60)
            self.assertEqual(set(refused), {"another thread is using this environment: call it from one thread at a time"})
        envs.step(actions)

    def test_a_closed_environment_says_so(self):
        path = self.script(CROWD)
        for env in (smartsurf.Env(path), smartsurf.VectorEnv(path, 2, 1), smartsurf.parallel_env(path, block=8)):
            env.reset(seed=1)
            env.close()
            env.close()
            with self.assertRaisesRegex(ValueError, "the environment is closed"):
                env.reset(seed=1)


class RecordedWorlds(ExperimentTest):
    """VectorEnv(record=…): one file per episode of the selected worlds, which smartsurf replay --verify repeats."""

    def verify(self, path):
        return subprocess.run([os.environ["SMARTSURF"], "replay", str(path), "--verify"], capture_output=True, text=True, timeout=120)

    def test_each_selected_episode_is_repeated_to_the_bit(self):
        for mode in ("NextStep", "SameStep"):
            with self.subTest(mode=mode):
                folder = self.folder / mode
                envs = smartsurf.VectorEnv(self.script(ENDINGS), 3, threads=2, autoreset_mode=mode, record=folder,
                                           record_worlds=[0, 2], record_every=2)
                envs.reset(seed=5)
                random, started = np.random.default_rng(1), np.ones(3, int)
                for _ in range(70):
                    actions = random.uniform(0, 2, envs.action_space.shape).astype(np.float32)
                    _, _, terminated, truncated, _ = envs.step(actions)
                    over = terminated | truncated
                    started += over
                if mode == "NextStep":  # one that has ended starts with the next step
                    started -= over
                envs.close()
                expected = {f"world-{w:04}-episode-{e:06}.h5" for w in (0, 2) for e in range(1, started[w] + 1, 2)}
                self.assertEqual({path.name for path in folder.iterdir()}, expected)
                self.assertGreaterEqual(len(expected), 4)
                for path in sorted(folder.iterdir())[:4]:
                    verified = self.verify(path)
                    self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)

    def test_the_file_of_a_world_that_fails_names_the_error(self):
        path = self.script(VERDICT_SCENE + """
at(0.2, function() if random() < 0.5 then error('broken') end end)
at(0.5, function() stop('reached', true) end)""")
        for mode in ("NextStep", "SameStep"):
            envs = smartsurf.VectorEnv(path, 8, record=self.folder / mode, autoreset_mode=mode)
            envs.reset(seed=1)
            ends = {}
            for _ in range(40):
                *_, infos = envs.step(np.zeros(envs.action_space.shape, np.float32))
                final = infos.get("final_info", infos)
                for i in np.flatnonzero(final.get("_error", np.zeros(8, bool))):
                    ends.setdefault(i, "broken")
                for i in np.flatnonzero(final.get("_metrics", np.zeros(8, bool))):
                    ends.setdefault(i, "stopped by the script: reached")
                    self.assertTrue(final["success"][i])
            envs.close()
            self.assertEqual(set(ends.values()), {"broken", "stopped by the script: reached"})
            for world, end in ends.items():
                text = subprocess.run([os.environ["SMARTSURF"], "info", self.folder / mode / f"world-{world:04}-episode-000001.h5"],
                                      capture_output=True, text=True, check=True, timeout=60).stdout
                self.assertRegex(text, f"outcome .*{end} after")

    def test_a_task_ends_its_recordings(self):
        class Brief(smartsurf.Task):
            scene = CROWD
            goals = {"ticks": (5, 12)}

            def success(self, state):
                return state.ticks >= state.goals["ticks"]

        for mode in ("NextStep", "SameStep"):
            envs = Brief().make_vec(2, record=self.folder / mode, autoreset_mode=mode)
            envs.reset(seed=1)
            lengths, running = [], np.zeros(2, int)
            for _ in range(30):
                _, _, terminated, truncated, _ = envs.step(np.ones(envs.action_space.shape, np.float32))
                running += 1
                lengths += list(running[terminated | truncated])
                running[terminated | truncated] = 0 if mode == "SameStep" else -1
            envs.close()
            files = sorted((self.folder / mode).iterdir())
            self.assertGreaterEqual(len(files), len(lengths))
            for path in files[:3]:
                self.assertEqual(self.verify(path).returncode, 0)
            try:
                import h5py
            except ImportError:
                self.skipTest("h5py is missing")
            recorded = []
            for path in files:
                with h5py.File(path) as file:
                    recorded.append(int(file["tick"][-1]))
            for length in lengths:
                recorded.remove(length)
            self.assertLessEqual(len(recorded), 2)  # those that run

    def test_interventions_are_marked_and_mistakes_named(self):
        path = self.script(CROWD)
        envs = smartsurf.VectorEnv(path, 2, record=self.folder / "r")
        envs.reset(seed=1)
        for tick in range(12):
            if tick == 6:
                envs.teleport(0, velocity=(3, 0, 0), worlds=[1])
            envs.step(np.ones(envs.action_space.shape, np.float32))
        envs.close()
        results = [self.verify(self.folder / f"r/world-{w:04}-episode-000001.h5").returncode for w in range(2)]
        self.assertEqual(results[0], 0)
        self.assertNotEqual(results[1], 0)
        with self.assertRaisesRegex(ValueError, r"worlds = \[2\]: must be"):
            smartsurf.VectorEnv(path, 2, record=self.folder / "r", record_worlds=[2])
        for given in ({"record_worlds": [1]}, {"record_every": 2}):
            with self.assertRaisesRegex(ValueError, "record_worlds and record_every need record"):
                smartsurf.VectorEnv(path, 2, **given)
        with self.assertRaisesRegex(ValueError, "record_every = 0"):
            smartsurf.VectorEnv(path, 2, record=self.folder / "r", record_every=0)

    def test_a_forked_child_does_not_record(self):
        program = """
import os, sys
import numpy as np
import smartsurf
path, folder, worlds, started, end = sys.argv[1:]
env = smartsurf.Env(path, record=folder) if worlds == "0" else smartsurf.VectorEnv(path, int(worlds), 2, record=folder)
def go(seed, steps):
    random = np.random.default_rng(seed)
    for _ in range(steps):
        action = random.uniform(0, 2, env.action_space.shape).astype(np.float32)
        *_, terminated, truncated, _ = env.step(action)
        if worlds == "0" and (terminated or truncated):
            env.reset()
if started == "True":
    env.reset(seed=1)
    go(1, 5)
pid = os.fork()
if pid == 0:
    env.reset(seed=2)
    go(2, 100)
    if end == "close":
        env.close()
    if end == "_exit":
        os._exit(0)
    sys.exit(0)
if end == "close":  # else while the child runs
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    assert os.path.exists(folder) == (started == "True")
if started == "False":
    env.reset(seed=1)
go(1, 60)
if end != "close":
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
env.close()
"""
        path = self.script(ENDINGS)
        for worlds in (0, 2):
            for started in (False, True):
                for end in ("close", "exit", "_exit"):
                    with self.subTest(worlds=worlds, started=started, end=end):
                        folder = self.folder / f"{worlds}-{started}-{end}"
                        done = subprocess.run([sys.executable, "-c", program, path, folder, str(worlds), str(started), end],
                                              capture_output=True, text=True, timeout=120)
                        self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))
                        files = sorted(folder.iterdir())
                        self.assertGreaterEqual(len(files), 2)
                        for file in files:
                            self.assertEqual(file.suffix, ".h5")
                            verified = self.verify(file)
                            self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)

    def test_a_folder_with_episodes_and_a_file_are_refused(self):
        path = self.script(CROWD)
        (self.folder / "file").write_text("")
        for make, name in ((lambda folder: smartsurf.Env(path, record=folder), "episode-000001.h5"),
                           (lambda folder: smartsurf.VectorEnv(path, 2, record=folder), "world-0000-episode-000001.h5")):
            folder = self.folder / name
            folder.mkdir()
            (folder / "notes.txt").write_text("")
            env = make(folder)
            env.reset(seed=1)
            env.step(sampled(env.action_space, 1))
            env.close()
            self.assertTrue((folder / name).exists())
            with self.assertRaisesRegex(ValueError, f"^record = '{folder}': has {name} of an earlier recording: give another folder$"):
                make(folder)
            with self.assertRaisesRegex(ValueError, f"^record = '{self.folder}/file': is a file: must be a folder"):
                make(self.folder / "file")
            with self.assertRaisesRegex(ValueError, "^embedded null character$"):
                make(f"{self.folder}/new\0er")
        for file in (f"{path}\0", f"{path}\0.lua"):
            with self.assertRaisesRegex(ValueError, "^embedded null character$"):
                smartsurf.VectorEnv(file, 2)

    def test_a_copy_draws_what_its_original_draws(self):
        path = self.script(CROWD)
        for make, spaces in ((lambda: smartsurf.Env(path), ("action_space", "observation_space")),
                             (lambda: smartsurf.VectorEnv(path, 2), ("action_space", "single_action_space", "observation_space")),
                             (lambda: smartsurf.parallel_env(path, block=4), ("_action_space", "_observation_space"))):
            env = make()
            env.reset(seed=1)
            for number, name in enumerate(spaces):
                getattr(env, name).seed(number)
                getattr(env, name).sample()
            for copied in (copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))):
                other = copied(env)
                for name in spaces:
                    np.testing.assert_array_equal(getattr(other, name).sample(), getattr(env, name).sample())

    def test_recordings_left_open_end_with_the_process(self):
        kinds = {"simulation": "s = smartsurf.Simulation(path, seed=1); s.record('simulation.h5')\nfor _ in range(3): s.step()",
                 "env": "e = smartsurf.Env(path, record='env'); e.reset(seed=1)\nfor _ in range(3): e.step(e.action_space.sample())",
                 "worlds": "v = smartsurf.VectorEnv(path, 2, 2, record='worlds'); v.reset(seed=1)\n"
                           "for _ in range(3): v.step(v.action_space.sample())"}
        path = self.script(CROWD)
        for end in ("", "raise ValueError", "import sys; sys.exit(3)", "del s, e, v; import gc; gc.collect(); import os; os._exit(0)"):
            folder = self.folder / str(len(end))
            folder.mkdir()
            subprocess.run([sys.executable, "-c", "\n".join([f"import smartsurf; path = {str(path)!r}", *kinds.values(), end])], cwd=folder,
                           capture_output=True, timeout=60)
            files = sorted(folder.rglob("*.h5"))
            self.assertEqual(len(files), 4)
            for file in files:
                info = subprocess.run([os.environ["SMARTSURF"], "info", str(file)], capture_output=True, text=True, timeout=60).stdout
                self.assertRegex(info, "\noutcome     done after 3 ticks", (end, file))

    def test_a_copy_does_not_record_and_says_so(self):
        path = self.script(CROWD)
        for number, make in enumerate((lambda folder: smartsurf.Env(path, record=folder),
                                       lambda folder: smartsurf.VectorEnv(path, 2, record=folder))):
            folder = self.folder / str(number)
            env = make(folder)
            for copied in (copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))):
                with self.assertWarnsRegex(UserWarning, "a copy of this environment does not record"):
                    other = copied(env)
                other.reset(seed=1)
                other.step(sampled(other.action_space, 1))
                other.close()
                self.assertFalse(folder.exists())
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                copy.deepcopy(make(None))
            env.reset(seed=1)
            env.close()
            self.assertTrue(folder.exists())


class Agents(ExperimentTest):
    def test_pettingzoo_accepts_it(self):
        from pettingzoo.test import parallel_api_test, parallel_seed_test
        path = self.script(CROWD.replace(", none = function() return nil end", ""))  # NaN differs from itself
        parallel_api_test(smartsurf.parallel_env(path, block=4), num_cycles=300)
        parallel_seed_test(lambda: smartsurf.parallel_env(path, block=8), num_cycles=20)

    def test_agents_see_and_drive_their_block(self):
        env = smartsurf.parallel_env(self.script(CROWD), block=4, radius=2)
        observations, _ = env.reset(seed=1)
        whole = np.pad(env.simulation._core.observation, ((0, 0), (2, 2), (2, 2)))
        np.testing.assert_array_equal(observations["block_1_2"], whole[:, 4:12, 8:16])
        with self.assertRaisesRegex(KeyError, "no agent 'block_4_0'; there are block_0_0 to block_3_3"):
            env.step({"block_4_0": np.zeros((1, 4, 4))})
        with self.assertRaisesRegex(ValueError, "^the action of block_0_0 has shape"):
            env.step({"block_0_0": np.zeros((2, 3))})
        with self.assertRaisesRegex(ValueError, "^actions: a list: must be a dict of agents"):
            env.step([1])
        infos = env.step({"block_1_2": np.full((1, 4, 4), 3, np.float32)})[4]
        infos["block_0_0"]["mine"] = 1
        self.assertNotIn("mine", infos["block_0_1"])
        expected = np.zeros((16, 16), np.float32)
        expected[4:8, 8:12] = 3
        np.testing.assert_array_equal(env.simulation.actuators["height"][1:-1, 1:-1], expected[1:-1, 1:-1])


if __name__ == "__main__":
    unittest.main()
