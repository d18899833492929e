"""Minari data sets of vector environments, read by Minari's own loader."""
import itertools
import os
import sys
import unittest

try:
    import h5py  # noqa: F401
    import minari
    import numpy as np
    import smartsurf
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ENDINGS, ExperimentTest


class Turn(smartsurf.Task):
    scene = ENDINGS.split("reward(")[0]
    goals = {"angle": (-3.0, 3.0)}

    def observation(self, state):
        return {"angle": state.goals["angle"], "place": state.position(0)}


class DataSets(ExperimentTest):
    def setUp(self):
        super().setUp()
        os.environ["MINARI_DATASETS_PATH"] = str(self.folder / "sets")
        self.addCleanup(os.environ.pop, "MINARI_DATASETS_PATH")

    def collect(self, envs):
        """The data set, read again, and what one Env or world would have seen: by seed, observations, actions and rewards."""
        collector, random = smartsurf.MinariCollector(envs), np.random.default_rng(3)
        collector.reset(seed=9)
        for _ in range(50):
            collector.step(random.uniform(0, 2, envs.action_space.shape).astype(np.float32))
        collector.create_dataset("table/random-v0", algorithm_name="random", author="nobody", author_email="nobody@example.org",
                                 code_permalink="https://example.org", description="of a test")
        return minari.load_dataset("table/random-v0")

    def test_the_loader_gives_what_an_environment_gives(self):
        fails = "on_reset(function() assert(math.random(3) > 1, 'early')"  # worlds that cannot start are left out
        scripts = (ENDINGS, ENDINGS.replace("on_reset(function()", fails))
        paths = map(self.script, scripts, ("sound.lua", "fails.lua"))
        for script, mode in itertools.product(paths, ("NextStep", "SameStep")):
            with self.subTest(script=script, mode=mode):
                data = self.collect(smartsurf.VectorEnv(script, 3, autoreset_mode=mode, seed=3))
                self.assertGreater(data.total_episodes, 5)
                ends = 0
                for episode, metadata in zip(data.iterate_episodes(), data.storage.get_episode_metadata(range(data.total_episodes))):
                    env = smartsurf.Env(script)
                    first, _ = env.reset(seed=int(metadata["seed"]))
                    np.testing.assert_array_equal(episode.observations[0], first)
                    for t, action in enumerate(episode.actions):
                        observation, reward, terminated, truncated, _ = env.step(action)
                        np.testing.assert_array_equal(episode.observations[t + 1], observation)
                        self.assertEqual((episode.rewards[t], episode.terminations[t]), (reward, terminated))
                    self.assertEqual(episode.truncations[-1], not terminated)
                    ends += terminated
                self.assertGreater(ends, 0)
                minari.delete_dataset("table/random-v0")

    def test_tasks_with_dicts_and_mistakes(self):
        data = self.collect(Turn().make_vec(2))
        episode = data[0]
        self.assertEqual(episode.observations["place"].shape, (len(episode.actions) + 1, 3))
        self.assertEqual(set(data.observation_space.spaces), {"angle", "place"})
        with self.assertRaisesRegex(ValueError, "there is no episode"):
            smartsurf.MinariCollector(Turn().make_vec(2)).create_dataset("table/none-v0")

    def test_episodes_stay_until_they_are_written(self):
        self.collect(smartsurf.VectorEnv(self.script(ENDINGS), 2))
        collector = smartsurf.MinariCollector(smartsurf.VectorEnv(self.script(ENDINGS), 2))
        collector.reset(seed=1)
        for _ in range(30):
            collector.step(np.ones(collector.action_space.shape, np.float32))
        keywords = dict(algorithm_name="flat", author="nobody", author_email="nobody@example.org",
                        code_permalink="https://example.org", description="of a test")
        with self.assertRaisesRegex(ValueError, "table/random-v0"):  # is there already
            collector.create_dataset("table/random-v0", **keywords)
        self.assertGreater(collector.create_dataset("table/flat-v0", **keywords).total_steps, 50)
        with self.assertRaisesRegex(ValueError, "there is no episode"):
            collector.create_dataset("table/more-v0", **keywords)


if __name__ == "__main__":
    unittest.main()
