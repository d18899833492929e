"""Arrays of the package as tensors of PyTorch and JAX, without a copy."""
import importlib.util
import sys
import unittest

try:
    import gymnasium  # noqa: F401
    import numpy as np
    import smartsurf
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import CROWD, ExperimentTest


class SharedArrays(ExperimentTest):
    def tensors(self, from_dlpack, to_numpy):
        """A tensor of the observations follows all steps, at the same address; so does an action that a tensor holds."""
        envs = smartsurf.VectorEnv(self.script(CROWD), 3, copy=False)
        observations, _ = envs.reset(seed=1)
        tensor = from_dlpack(observations)
        self.assertEqual(to_numpy(tensor).__array_interface__["data"][0], observations.__array_interface__["data"][0])
        before = observations.copy()
        for _ in range(10):
            envs.step(np.full(envs.action_space.shape, 2, np.float32))
        self.assertFalse((before == observations).all())
        np.testing.assert_array_equal(to_numpy(tensor), observations)
        return envs, tensor

    @unittest.skipUnless(importlib.util.find_spec("torch"), "torch is missing: scripts/setup --learn installs it")
    def test_torch(self):
        import torch
        envs, tensor = self.tensors(torch.from_dlpack, lambda t: t.numpy())
        self.assertEqual((tensor.dtype, tuple(tensor.shape)), (torch.float32, envs.observation_space.shape))
        # Actions of a tensor are taken without a copy too: the batch reads them in place.
        action = torch.full(envs.action_space.shape, 2.0)
        self.assertTrue(np.shares_memory(np.asarray(action), action.numpy()))
        twin = smartsurf.VectorEnv(self.script(CROWD), 3)
        envs.reset(seed=4), twin.reset(seed=4)
        for _ in range(5):
            envs.step(action.numpy()), twin.step(np.full(envs.action_space.shape, 2, np.float32))
        self.assertEqual([envs.state_hash(i) for i in range(3)], [twin.state_hash(i) for i in range(3)])

    @unittest.skipUnless(importlib.util.find_spec("jax"), "jax is missing: pip install jax")
    def test_jax(self):
        import jax
        self.tensors(jax.dlpack.from_dlpack, lambda t: np.from_dlpack(t))

    def test_numpy(self):
        self.tensors(np.from_dlpack, lambda t: t)


if __name__ == "__main__":
    unittest.main()
