"""Tasks in Python: the same in one world, in many and on a live surface."""
import copy
import os
import pathlib
import pickle
import subprocess
import sys
import tempfile
import unittest
import warnings

try:
    import gymnasium
    import numpy as np
    import smartsurf
    from gymnasium.vector import AutoresetMode
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ExperimentTest

SCENE = """
surface { rows = 6, columns = 8, border = { height = 4 }, actuator = pin { range = {0, 2} },
          sensors = { proximity { range = 6 }, colour { range = 6 } } }
box { size = {1.6, 1.2, 1}, position = {3.5, 2.5, 3}, label = 'box' }
sphere { radius = 0.6, position = {5, 3, 3}, label = 'ball' }
sphere { radius = 0.5, position = {2, 3, 3}, label = 'ball' }
"""


# Some worlds cannot start, some fail later.
FAILING = """
surface { rows = 2, columns = 2, actuator = pin { range = {0, 4} }, sensors = { proximity { range = 4 } } }
local ball, broken = sphere { radius = 0.4, position = {1, 1, 3} }
on_reset(function()
  object(ball):teleport { position = {random(0.5, 1.5), random(0.5, 1.5), 3} }
  broken = random(4, 40) // 1
  assert(random() < 0.7, 'early')
end)
on_tick(function(t, tick) assert(tick ~= broken, 'late') end)
info { x = function() local x = object(ball):position() return x end }
reward(function(t, tick) return tick end)
episode { seconds = 0.4 }
on_finish(function(t) metric('t', t) end)
"""


class Failing(smartsurf.Task):
    """Fails in all ways."""
    scene = FAILING

    def reward(self, s):
        return np.where((s.position(0)[:, 0] > 1.4) & (s.ticks > 3), np.nan, 1)

    def observation(self, s):
        return np.column_stack([s.position(0), s.time])


class Reach(smartsurf.Task):
    """Observes a dict; ends in all ways."""
    scene = SCENE
    episode_seconds = 0.5
    parameters = {"surface.friction": 0.3}
    randomise = {"object.box.mass": (1, 4), "object.box.position": ((3, 2, 3), (4, 3, 3))}
    goals = {"place": ((3, 2), (5, 4)), "height": (0.2, 1.2)}

    def reward(self, s):
        return -np.linalg.norm(s.position("box")[:, :2] - s.goals["place"], axis=1) + s.actions["height"].mean(axis=(1, 2))

    def success(self, s):
        return (s.time > 0.2) & (s.position("box")[:, 2] < s.goals["height"] + 1.4)

    def failure(self, s):
        return (s.ticks > 5) & (s.position("ball")[:, 0, 0] > 5.02)

    def observation(self, s):
        return {"planes": smartsurf.planes(s), "pose": np.column_stack([s.position("box"), s.yaw("box"), s.goals["place"]]),
                "clock": np.column_stack([s.time, s.actions["height"].mean(axis=(1, 2))])}

    def metrics(self, s):
        return {"x": s.position("box")[:, 0], "speed": np.linalg.norm(s.velocity(2), axis=-1)}


class Sensed(smartsurf.Task):
    """Sees, and is judged by, what a live surface has too."""
    scene = SCENE
    goals = {"level": (0, 1)}
    episode_seconds = 0.3

    def reward(self, s):
        return s.sensors["proximity"].mean(axis=(1, 2)) - s.goals["level"] + s.actions["height"][:, 2, 3]

    def metrics(self, s):
        return {"colour": s.sensors["colour"].sum(axis=(1, 2, 3)), "tick": s.ticks}


def command(tick, shape):
    return np.random.default_rng(tick // 3).uniform(0, 2, shape).astype(np.float32)


def flat(observation):
    return list(observation.values()) if isinstance(observation, dict) else [observation]


class Tasks(ExperimentTest):
    def assert_same(self, one, other):
        for a, b in zip(flat(one), flat(other), strict=True):
            np.testing.assert_array_equal(a, b)

    def test_worlds_equal_single_environments_in_every_autoreset_mode(self):
        for mode in AutoresetMode:
            with self.subTest(mode=mode.value):
                task, n = Reach(), 5
                envs = task.make_vec(n, threads=2, autoreset_mode=mode)
                singles = [task.make() for _ in range(n)]
                observations, infos = envs.reset(seed=4)
                for i, env in enumerate(singles):
                    observation, info = env.reset(seed=4 + i)
                    self.assert_same({k: v[i] for k, v in observations.items()}, observation)
                    np.testing.assert_array_equal(info["place"], infos["place"][i])
                over, ends = np.zeros(n, bool), {"success": 0, "failure": 0, "time": 0}
                for tick in range(90):
                    actions = command(tick, envs.action_space.shape)
                    observations, rewards, terminated, truncated, infos = envs.step(actions)
                    ended = terminated | truncated
                    last = infos["final_info"] if "final_info" in infos else infos
                    for i, env in enumerate(singles):
                        if over[i] and mode == AutoresetMode.NEXT_STEP:
                            expected = (env.reset(seed=int(infos["seed"][i]))[0], 0.0, False, False)
                        else:
                            *expected, info = env.step(actions[i])
                            if ended[i]:
                                self.assertEqual({k: v[i] for k, v in last["metrics"].items() if not k.startswith("_")},
                                                 info["metrics"])
                                kind = "time" if truncated[i] else "success" if info["success"] else "failure"
                                ends[kind] += 1
                                self.assertEqual(bool(last["success"][i]), info["success"])
                        self.assertEqual((rewards[i], terminated[i], truncated[i]), tuple(expected[1:]))
                        if ended[i] and mode == AutoresetMode.SAME_STEP:
                            self.assert_same(infos["final_obs"][i], expected[0])
                            self.assertEqual(int(last["seed"][i]), env._envs._fields["seed"][0])
                            expected[0] = env.reset(seed=int(infos["seed"][i]))[0]
                        self.assert_same({k: v[i] for k, v in observations.items()}, expected[0])
                    over = ended
                    if mode == AutoresetMode.DISABLED and ended.any():
                        seeds = [100 * tick + i for i in range(n)]
                        envs.reset(seed=seeds, options={"reset_mask": ended})
                        for i in np.flatnonzero(ended):
                            singles[i].reset(seed=seeds[i])
                        over[:] = False
                self.assertTrue(all(ends.values()), ends)

    def test_gymnasium_accepts_tasks(self):
        from gymnasium.utils.env_checker import check_env
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for task in (Reach(), Sensed()):
                check_env(task.make(), skip_render_check=True)
            Reach.register("Reach-v0")
            self.assertEqual(gymnasium.make("Reach-v0").unwrapped.task.episode_seconds, 0.5)
            envs = gymnasium.make_vec("Reach-v0", num_envs=3)
        observations, _ = envs.reset(seed=1)
        self.assertIn(observations, envs.observation_space)

    def test_the_default_observation_is_that_of_env_and_vector_env(self):
        path = self.script(SCENE)
        task, plain, env = Sensed().make_vec(3, threads=1), smartsurf.VectorEnv(path, 3, 1), smartsurf.Env(path)
        self.assertEqual(task.observation_space, plain.observation_space)
        self.assertEqual(Sensed().make().observation_space, env.observation_space)
        self.assert_same(task.reset(seed=1)[0], plain.reset(seed=1)[0])
        for tick in range(10):
            actions = command(tick, plain.action_space.shape)
            self.assert_same(task.step(actions)[0], plain.step(actions)[0])

    def test_a_surface_without_sensors_has_observations_without_planes(self):
        class Blind(smartsurf.Task):
            scene = "surface { rows = 4, columns = 6, actuator = pin { range = {0, 1} } }"

        envs = Blind().make_vec(2)
        self.assertEqual(envs.observation_space, smartsurf.VectorEnv(self.script(Blind.scene), 2).observation_space)
        self.assertEqual(envs.reset(seed=1)[0].shape, (2, 0, 4, 6))
        self.assertEqual(Blind().make().reset(seed=1)[0].shape, (0, 4, 6))

    def test_options_of_each_world_add_to_those_of_the_task(self):
        class Optional(Sensed):
            scene = "option('a', 1)\noption('b', 1)\n" + SCENE
            set = {"a": 5}

        for given, expected in ((None, [1, 1]), ({"b": 2}, [2, 2]), ([{"b": 2}, {"b": 3}], [2, 3]), (({}, {"b": 3}), [1, 3])):
            self.assertEqual(Optional().make_vec(2, set=given).options, [{"a": "5", "b": str(b)} for b in expected])
        self.assertEqual([o["a"] for o in Optional().make_vec(2, set=[{"a": 2}, {}]).options], ["2", "5"])
        for given in (5, "ab", [{}], [{}, 3]):
            with self.assertRaisesRegex(ValueError, "^set = "):
                Optional().make_vec(2, set=given)

    def test_actions_of_the_state_are_the_commands(self):
        class Judged(Sensed):
            scene = SCENE

            def reward(self, s):
                return s.actions["height"].sum(axis=(1, 2))

            def success(self, s):
                return False

        given = np.full((1, 6, 8), 0.5, np.float32)
        given[0, 0, :5] = np.nan, 9, -3, np.inf, -np.inf
        safe = smartsurf.Env(self.script(SCENE)).simulation.actuator_channels[0].safe
        expected = 0.5 * (6 * 8 - 5) + safe + 2 + 0 + 2 + 0
        envs, env = Judged().make_vec(2, threads=1), Judged().make()
        envs.reset(seed=1), env.reset(seed=1)
        self.assertEqual(envs.step(np.stack([given, given]))[1].tolist(), [expected] * 2)
        self.assertEqual(envs.state().actions["height"][1, 0, :3].tolist(), [safe, 2, 0])
        self.assertEqual(env.step(given)[1], expected)

    def test_cells_as_agents_see_and_are_rewarded_as_the_task_says(self):
        from pettingzoo.test import parallel_api_test
        cells, env = smartsurf.parallel_env(Sensed(), block=2, radius=0), Sensed().make()
        for seed in (3, 4):
            observations, infos = cells.reset(seed=seed)
            whole, info = env.reset(seed=seed)
            over = False
            while not over:
                for agent, seen in observations.items():
                    row, column = (2 * int(part) for part in agent.split("_")[1:])
                    np.testing.assert_array_equal(seen, whole[:, row:row + 2, column:column + 2])
                action = command(int(info["success"]) + seed, env.action_space.shape)
                observations, rewards, terminated, truncated, infos = cells.step(
                    {agent: action[:, 2 * r:2 * r + 2, 2 * c:2 * c + 2] for agent, (r, c) in cells._places.items()})
                whole, reward, *ends, info = env.step(action)
                self.assertEqual(set(rewards.values()), {reward})
                self.assertEqual([terminated["block_0_0"], truncated["block_0_0"]], ends)
                over = any(ends)
            self.assertEqual(infos["block_0_0"]["metrics"], info["metrics"])
        parallel_api_test(smartsurf.parallel_env(Sensed(), block=2, radius=1), num_cycles=30)

    def test_goals_follow_from_the_seed_and_are_independent(self):
        envs = Reach().make_vec(300, threads=2)
        _, infos = envs.reset(seed=1)
        place, height = infos["place"], infos["height"]
        for values, low, high in ((place[:, 0], 3, 5), (place[:, 1], 2, 4), (height, 0.2, 1.2)):
            self.assertTrue(low <= values.min() < low + 0.1 * (high - low) and high - 0.1 * (high - low) < values.max() <= high)
        drawn = np.column_stack([place, height, envs.get_parameter("object.box.mass"),
                                 envs.get_parameter("object.box.position")[:, :2]])
        self.assertLess(np.abs(np.corrcoef(drawn, rowvar=False) - np.eye(6)).max(), 0.25)
        again = Reach().make_vec(2, threads=1)
        _, infos = again.reset(seed=[300, 17])
        np.testing.assert_array_equal(infos["place"], place[[299, 16]])

    def test_a_live_surface_has_the_same_observations_and_rewards(self):
        path, name = self.script(SCENE), f"task-{os.getpid()}"
        here = Sensed().make()
        here.reset(seed=3)
        simulator = subprocess.Popen([os.environ["SMARTSURF"], "run", path, "--shm", name, "--seed", "3", "--until", "0.5"])
        self.addCleanup(pathlib.Path(f"/dev/shm/smartsurf.{name}").unlink, missing_ok=True)  # a killed surface leaves its segment
        self.addCleanup(simulator.wait)
        self.addCleanup(simulator.kill)
        env = Sensed().make(shm=name)
        self.assertEqual((env.observation_space, env.action_space), (here.observation_space, here.action_space))
        observation, info = env.reset(seed=None)
        here.worlds._judge.goals["level"][0] = info["level"]
        for tick in range(18):
            action = command(tick, env.action_space.shape)
            one, other = env.step(action), here.step(action)
            np.testing.assert_array_equal(one[0], other[0])
            self.assertEqual(one[1:4], other[1:4])
        self.assertTrue(one[3])
        self.assertEqual(one[4]["metrics"], other[4]["metrics"])
        env.close()
        with self.assertRaisesRegex(ValueError, "a live surface does not know its objects"):
            smartsurf.State({}, {}, {}, 0, 0, 1, None, (), {}, None).position("box")

    def test_a_pickled_copy_continues_with_the_same_bits(self):
        for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            envs = Reach().make_vec(4, threads=2, autoreset_mode=mode)
            envs.reset(seed=6)
            for ticks in (4, 14, 1, 1, 11):
                for tick in range(ticks):
                    envs.step(command(tick, envs.action_space.shape))
                twin = pickle.loads(pickle.dumps(envs))
                for tick in range(40):
                    a, b = (one.step(command(tick, envs.action_space.shape)) for one in (envs, twin))
                    self.assert_same(a[0], b[0])
                    for x, y in zip(a[1:4], b[1:4]):
                        np.testing.assert_array_equal(x, y)
                    np.testing.assert_array_equal(a[4]["place"], b[4]["place"])
        env = Sensed().make()
        env.reset(seed=1)
        again = pickle.loads(pickle.dumps(env))
        self.assert_same(env.step(command(1, env.action_space.shape))[0], again.step(command(1, env.action_space.shape))[0])

    def assert_equal(self, one, other):
        """What reset() or step() returns, to the bit."""
        if isinstance(one, (tuple, list)):
            for a, b in zip(one, other, strict=True):
                self.assert_equal(a, b)
        elif isinstance(one, dict):
            self.assertEqual(one.keys(), other.keys())
            self.assert_equal(list(one.values()), list(other.values()))
        elif isinstance(one, np.ndarray) and one.dtype == object:
            self.assert_equal(one.tolist(), other.tolist())
        elif isinstance(one, str):
            self.assertEqual(one, other)
        else:
            np.testing.assert_array_equal(one, other)

    def test_worlds_that_fail_follow_from_their_seed_and_are_copied(self):
        def results(envs, call, *arguments, **named):
            try:
                return getattr(envs, call)(*arguments, **named)
            except smartsurf.Error as error:
                return str(error)
        makes = (lambda **named: smartsurf.VectorEnv("t.lua", 4, threads=2, source=FAILING, **named),
                 lambda **named: Failing().make_vec(4, threads=2, **named))
        for mode in AutoresetMode:
            for kind, make in enumerate(makes):
                one, other = (make(autoreset_mode=mode, seed=s) for s in (1, 5))
                failures = 0
                for seed in range(4):
                    chance = np.random.default_rng(seed)
                    self.assert_equal(*(results(envs, "reset", seed=seed) for envs in (one, other)))
                    for tick in range(40):
                        actions = command(tick, one.action_space.shape)
                        left, right = (results(envs, "step", actions) for envs in (one, other))
                        with self.subTest(mode=mode.value, kind=kind, seed=seed, tick=tick):
                            self.assert_equal(left, right)
                        if isinstance(left, str):
                            self.assert_equal(*(results(envs, "reset") for envs in (one, other)))
                            continue
                        self.assertTrue(np.isfinite(left[0]).all())
                        failures += np.isnan(left[1]).sum()
                        over = left[2] | left[3]
                        if mode == AutoresetMode.DISABLED and over.any() and chance.random() < 0.5:
                            self.assert_equal(*(results(envs, "reset", options={"reset_mask": over}) for envs in (one, other)))
                        if chance.random() < 0.3:
                            one = copy.deepcopy(one) if chance.random() < 0.5 else pickle.loads(pickle.dumps(one))
                self.assertGreater(failures, 20)

    def test_a_checkpoint_has_the_worlds_that_fail(self):
        from smartsurf import training
        with tempfile.TemporaryDirectory() as folder:
            file, failures = pathlib.Path(folder) / "checkpoint.npz", 0
            for seed in range(6):
                one, other = (Failing().make_vec(8, threads=1, autoreset_mode="Disabled", seed=s) for s in (seed, 99))
                one.reset(seed=seed)
                for tick in range(3 * seed):
                    failures += np.isnan(one.step(command(tick, one.action_space.shape))[1]).sum()
                training._write_checkpoint(file, one._save_worlds())
                other._restore_worlds(training._read_checkpoint(file))
                for tick in range(12):
                    left, right = (envs.step(command(tick, one.action_space.shape)) for envs in (one, other))
                    self.assert_equal(left, right)
            self.assertGreater(failures, 20)

    def test_a_copy_of_a_failed_world_has_failed(self):
        def said(env, call, *arguments, **named):
            try:
                getattr(env, call)(*arguments, **named)
            except smartsurf.Error as error:
                return str(error)
            return ""
        env, kinds = Failing().make(seed=next(s for s in range(20) if not said(Failing(), "make", seed=s))), set()
        still = np.zeros(env.action_space.shape)
        for seed in range(30):
            error = said(env, "reset", seed=seed)
            for tick in range(15):
                error = error or said(env, "step", still)
            kinds.add(error.split(": ")[-1])
            twins = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
            expected = [said(env, "step", still) for _ in range(2)]
            for one in twins:
                self.assertEqual([said(one, "step", still) for _ in range(2)], expected)
        self.assertEqual(kinds, {"", "early", "late", "must be finite"})

    def test_success_at_the_start_ends_the_first_step(self):
        scene = SCENE + "on_reset(function() easy = random() < 0.5 end)\ninfo { easy = function() return easy and 1 or 0 end }\n"

        class Easy(smartsurf.Task):
            def success(self, s):
                return (s.info["easy"] == 1) & (s.ticks == 0)
        Easy.scene = scene
        lua = scene + "success(function(t, tick) return easy and tick == 0 end)\nepisode { seconds = 0.1 }"
        Easy.episode_seconds = 0.1
        for mode in AutoresetMode:
            with self.subTest(mode=mode.value):
                task, script = (make(8, threads=2, autoreset_mode=mode) for make in (
                    Easy().make_vec, lambda *a, **b: smartsurf.VectorEnv("t.lua", *a, source=lua, **b)))
                ends = 0
                for tick in range(30):
                    if tick == 0:
                        (_, infos), (_, others) = (envs.reset(seed=5) for envs in (task, script))
                        np.testing.assert_array_equal(infos["success"], infos["easy"] == 1)
                        easy = infos["success"]
                        self.assertTrue(0 < easy.sum() < 8)
                    else:
                        (_, _, *flags, infos), (_, _, *expected, others) = (
                            envs.step(np.zeros(envs.action_space.shape)) for envs in (task, script))
                        self.assert_equal(flags, expected)
                        if tick == 1:
                            np.testing.assert_array_equal(flags[0], easy)
                        ends += flags[0].sum()
                        over = flags[0] | flags[1]
                        if mode == AutoresetMode.DISABLED and over.any():
                            (_, infos), (_, others) = (envs.reset(options={"reset_mask": over}) for envs in (task, script))
                    self.assert_equal(infos["success"], others["success"])
                    if tick % 7 == 3:
                        task, script = copy.deepcopy(task), copy.deepcopy(script)
                self.assertGreater(ends, 8)
        one = Easy().make()
        seed = next(s for s in range(20) if one.reset(seed=s)[1]["success"])
        for env in (one, smartsurf.Env("t.lua", source=lua)):
            self.assertTrue(env.reset(seed=seed)[1]["success"])
            _, _, terminated, _, info = env.step(np.zeros(env.action_space.shape))
            self.assertTrue(terminated and info["success"])

    def test_observations_of_one_number_are_arrays(self):
        class Height(Sensed):
            def observation(self, s):
                return {"height": s.position()[:, 0, 2], "place": s.position()[:, 0]}

        class Number(Sensed):
            def observation(self, s):
                return s.position()[:, 0, 2]
        for task in (Height(), Number()):
            env = task.make()
            for observation in (env.reset(seed=1)[0], env.step(command(1, env.action_space.shape))[0]):
                for value in observation.values() if isinstance(observation, dict) else [observation]:
                    self.assertIsInstance(value, np.ndarray)
                self.assertTrue(env.observation_space.contains(observation))

    def test_a_world_that_fails_is_quarantined(self):
        class Failing(Sensed):
            scene = SCENE + "local bad = false\n" \
                            "on_reset(function() bad = random() < 0.3 end)\n" \
                            "on_tick(function(t) if bad and t > 0.1 then error('broken') end end)"

            def observation(self, s):
                return s.position()
        for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            envs = Failing().make_vec(8, threads=2, autoreset_mode=mode)
            envs.reset(seed=1)
            failures = 0
            for tick in range(60):
                observation, rewards, terminated, truncated, infos = envs.step(command(tick, envs.action_space.shape))
                failed = np.isnan(rewards)
                self.assertTrue(np.isfinite(observation).all())
                self.assertTrue(all(np.isfinite(last).all() for last in infos.get("final_obs", ()) if last is not None))
                self.assertFalse((failed & ~truncated).any())
                if failed.any():
                    final = infos.get("final_info", infos)
                    self.assertTrue(all("broken" in final["error"][i] for i in np.flatnonzero(failed)))
                    failures += int(failed.sum())
            self.assertGreater(failures, 3)
            self.assertLess(failures, 120)

    def test_a_world_that_cannot_start_is_quarantined(self):
        class Failing(Sensed):
            scene = SCENE + "on_reset(function() if random() < 0.3 then error('broken') end end)"

            def observation(self, s):
                return s.position()
        for mode in AutoresetMode:
            with self.subTest(mode=mode.value):
                envs = Failing().make_vec(16, threads=2, autoreset_mode=mode, seed=1)
                observation, infos = envs.reset(seed=1)
                failed = infos["_error"]
                self.assertTrue(0 < failed.sum() < 16 and np.isfinite(observation).all())
                for tick in range(60):
                    observation, rewards, terminated, truncated, infos = envs.step(command(tick, envs.action_space.shape))
                    self.assertTrue(np.isfinite(observation).all())
                    if tick == 0:
                        np.testing.assert_array_equal(np.isnan(rewards), failed)
                    final = infos.get("final_info", infos)
                    self.assertTrue(all("broken" in final["error"][i] for i in np.flatnonzero(np.isnan(rewards))))
                    if mode == AutoresetMode.DISABLED and (terminated | truncated).any():
                        envs.reset(options={"reset_mask": terminated | truncated})

    def test_a_reward_that_is_not_finite_ends_its_world(self):
        class Undefined(Reach):
            def reward(self, s):
                return np.where((s.ticks == 3) & (s.goals["height"] < 0.7), np.nan, 1.0)
        for mode in AutoresetMode:
            envs = Undefined().make_vec(8, threads=1, autoreset_mode=mode)
            _, infos = envs.reset(seed=1)
            bad = infos["height"] < 0.7
            self.assertTrue(0 < bad.sum() < 8)
            for tick in range(3):
                _, rewards, terminated, truncated, infos = envs.step(command(tick, envs.action_space.shape))
            np.testing.assert_array_equal(np.isnan(rewards), bad)
            np.testing.assert_array_equal(truncated, bad)
            self.assertFalse(terminated[bad].any())
            final = infos.get("final_info", infos)
            for i in np.flatnonzero(bad):
                self.assertEqual(final["error"][i], f"Undefined.reward is nan in world {i}: must be finite")
            if mode == AutoresetMode.DISABLED:
                envs.reset(options={"reset_mask": bad})
            self.assertTrue(np.isfinite(envs.step(command(3, envs.action_space.shape))[1]).all())
        for name in ("success", "failure"):
            judged = lambda self, s: np.where((s.ticks == 3) & (s.goals["height"] < 0.7), np.nan, 0)
            envs = type("Unclear", (Reach,), {"reward": lambda self, s: 1.0, name: judged})().make_vec(8, threads=1)
            envs.reset(seed=1)
            for tick in range(3):
                _, rewards, terminated, truncated, infos = envs.step(command(tick, envs.action_space.shape))
            np.testing.assert_array_equal(np.isnan(rewards), bad)
            np.testing.assert_array_equal(truncated, bad)
            self.assertFalse(terminated[bad].any() or infos["success"].any())
            for i in np.flatnonzero(bad):
                self.assertEqual(infos["error"][i], f"Unclear.{name} is nan in world {i}: must be finite")
        for arguments, worlds in (({"strict": True}, 8), ({}, 1)):
            envs = Undefined().make_vec(worlds, threads=1, **arguments)
            envs.reset(seed=[seed for seed in range(1, 9) if worlds == 8 or bad[seed - 1]][:worlds])
            with self.assertRaisesRegex(smartsurf.Error, "Undefined.reward is nan"):
                for tick in range(3):
                    envs.step(command(tick, envs.action_space.shape))

    def test_mistakes_name_the_function(self):
        def changed(**members):
            return type("Mine", (Sensed,), members)()
        for task, message in (
                (changed(scene=None), "Mine: give either script, a path, or scene"),
                (changed(script="a.lua"), "give either"),
                (changed(goals={"level": 3}), r"goals: level = 3: must be \(low, high\)"),
                (changed(goals={"level": (2, 1)}), "low must not be above high"),
                (changed(goals={"level": ((0, 0, 0), (1, 1))}), r"goals: level: low, of shape \(3,\), and high, of shape \(2,\)"),
                (changed(arrays="cupy"), "arrays = 'cupy': must be"),
                (changed(randomise={"object.cup.mass": (1, 2)}), "no 'cup'"),
                (changed(parameters={"surface.friction": -1}), "friction = -1"),
                (changed(episode_seconds=0), "episode_seconds = 0: must be a number above 0"),
                (changed(episode_seconds="3"), "episode_seconds = '3'"),
                (changed(goals={"seed": (0, 1)}), "goals: seed: infos have another value"),
                (changed(goals={"metrics": (0, 1)}), "goals: metrics: infos have another value"),
                (changed(observation=lambda self, s: np.zeros(7)), r"Mine.observation has shape \(7,\): must be \(2, …\)")):
            with self.assertRaisesRegex(ValueError, message) as raised:
                task.make_vec(2)
            self.assertNotIn("\n", str(raised.exception))
        for members, message in (({"reward": lambda self, s: np.zeros((2, 2))}, r"Mine.reward returned an array of shape \(2, 2\)"),
                                 ({"success": lambda self, s: [True]}, "Mine.success returned"),
                                 ({"observation": lambda self, s: np.zeros((2, 1 + s.ticks[0]))}, "must have those of the first"),
                                 ({"observation": lambda self, s: {f"x{s.ticks[0]}": s.time}}, "must have those of the first"),
                                 ({"reward": lambda self, s: "much"}, "Mine.reward has values of type .*: must be real numbers"),
                                 ({"success": lambda self, s: None}, "Mine.success has values of type object: must be real numbers"),
                                 *((dict(failure=lambda self, s: True, metrics=lambda self, s, given=given: given), message)
                                   for given, message in (([1], "Mine.metrics returned a list: must be a dict"),
                                                          (None, "Mine.metrics returned a NoneType: must be a dict"),
                                                          ({"x": "y"}, r"Mine.metrics\['x'\] has values of type"),
                                                          ({"x": [1, 2, 3]}, r"Mine.metrics\['x'\] returned an array of shape")))):
            with self.assertRaisesRegex(ValueError, message):
                envs = changed(**members).make_vec(2)
                envs.reset(seed=1)
                envs.step(np.zeros(envs.action_space.shape, np.float32))

        for member in ("sensors['proximity']", "actions['height']", "goals['level']", "time", "ticks", "position('box')"):
            def writes(self, s, member=member):
                exec(f"s.{member}[...] = 0")
            envs = changed(reward=writes).make_vec(2)
            with self.assertRaisesRegex(ValueError, "read-only"):
                envs.step(np.zeros(envs.action_space.shape, np.float32))

    def test_misspelt_declarations_are_refused(self):
        for name, value in (("randomize", {"object.box.mass": (1, 2)}), ("goal", {"level": (0, 1)}), ("episode_second", 3)):
            with self.assertRaisesRegex(TypeError, rf"Mine.{name}: a Task has no such attribute \(did you mean '(randomise|goals|episode_seconds)'"):
                type("Mine", (Sensed,), {name: value})
        judge = lambda self, state: np.zeros(len(state.time))
        for name, meant in (("sucess", "success"), ("rewards", "reward"), ("obervation", "observation")):
            with self.assertRaisesRegex(TypeError, rf"Mine.{name}: a Task has no such function \(did you mean '{meant}'"):
                type("Mine", (smartsurf.Task,), {name: judge})
            type("Mine", (smartsurf.Task,), {name: judge, meant: judge})  # a helper
        type("Mine", (Sensed,), {"goal": (3, 4), "scale": 2, "array": np.zeros(3), "setup": lambda self: 0})

    def test_state_has_the_commands_of_a_controller_and_of_a_restored_world(self):
        class Commanded(Sensed):
            def reward(self, s):
                return s.actions["height"][:, 2:4, 3].sum(axis=1)

            def observation(self, s):
                return {"box": s.position("box"), "height": s.actions["height"][:, 1:-1, 1:-1]}  # without the border

        program = self.script("while(1)\n  surface.actuate('height', 1.5)\n  surface.step\nendwhile\n", "up.aps")
        given, controlled = Commanded().make_vec(2), Commanded().make_vec(2, controller=program)
        one = Commanded().make(controller=program)
        for envs in (given, controlled, one):
            envs.reset(seed=3)
        actions = np.full(given.action_space.shape, 1.5, np.float32)
        for _ in range(4):
            *expected, _ = given.step(actions)
            *stepped, _ = controlled.step()
            observation, reward, *_ = one.step()
            for a, b in zip(expected, stepped):
                self.assert_same(a, b)
            self.assertEqual(reward, expected[1][0])
            self.assert_same({name: values[0] for name, values in expected[0].items()}, observation)
        self.assert_same(given.restore(0, given.save(0)), observation)
        with self.assertRaisesRegex(ValueError, "the controller commands the actuators: step\\(\\) takes no actions"):
            one.step(actions[0])

    def test_torch(self):
        try:
            import torch
        except ImportError:
            self.skipTest("PyTorch is not installed")

        class Tensors(Reach):
            arrays = "torch"

            def reward(self, s):
                return (-torch.linalg.norm(s.position("box")[:, :2] - s.goals["place"].float(), dim=1)
                        + s.actions["height"].mean(dim=(1, 2)))

            def observation(self, s):
                return torch.cat([s.position("box"), s.yaw("box")[:, None], torch.flatten(smartsurf.planes(s), 1)], dim=1)
        envs, numpy = Tensors().make_vec(3, threads=1), Reach().make_vec(3, threads=1)
        envs.reset(seed=1), numpy.reset(seed=1)
        for tick in range(10):
            actions = command(tick, envs.action_space.shape)
            np.testing.assert_allclose(envs.step(actions)[1], numpy.step(actions)[1], rtol=1e-5, atol=1e-6)


if __name__ == "__main__":
    unittest.main()
