"""Local policies as ONNX models: onnxruntime gives the commands of the NumPy policy, to the bit."""
import sys
import unittest

try:
    import numpy as np
    import onnxruntime
    from smartsurf.policy import LocalPolicy, export_onnx
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ExperimentTest

INPUTS = ["proximity", "colour.g", "row", "column", "proximity"]
ACTIONS = [("height", 0, 4), ("spin_a", -3.0, 2.0), ("flow", 0, 1e-3)]


class Onnx(ExperimentTest):
    def test_random_policies_give_equal_commands(self):
        random = np.random.default_rng(1)
        for case in range(24):
            inputs, actions = INPUTS[:random.integers(1, 6)], ACTIONS[:random.integers(1, 4)]
            if case % 5 == 4:
                inputs = ["column", "proximity", "row"]
            memory, hidden = int(random.integers(0, 3)), tuple(random.integers(1, 6, size=random.integers(0, 3)))
            diagonal, steps = bool(case % 2), int(random.integers(1, 3)) if memory else 1
            count = LocalPolicy.parameters(len(inputs), len(actions), hidden, memory, diagonal)
            vector = random.standard_normal(count) * (random.random(count) < random.choice([0.1, 0.7, 1]))
            policy = LocalPolicy.from_vector(vector, inputs, actions, hidden, memory, steps, diagonal)
            path = self.folder / f"{case}.onnx"
            export_onnx(policy, path)
            session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
            for shape in ((1, 1, 1), (3, 5, 7), (2, 1, 9)):
                policy.reset()
                kept = [np.zeros(shape, np.float32)] * memory
                for tick in range(3):
                    observation = {"proximity": random.standard_normal(shape).astype(np.float32) * 5,
                                   "colour": random.random((shape[0], 3, *shape[1:])).astype(np.float32)}
                    sensed = {"proximity": observation["proximity"], "colour.g": observation["colour"][:, 1]}
                    feed = {i.name: sensed[i.name] if i.name in sensed else kept[int(i.name.removeprefix("MEMORY"))]
                            for i in session.get_inputs()}
                    outputs = session.run(None, feed)
                    self.assertEqual([o.name for o in session.get_outputs()],
                                     [a[0] for a in actions] + [f"NEXT_MEMORY{k}" for k in range(memory)])
                    for output, (channel, *_), command in zip(outputs, actions, policy(observation).values()):
                        self.assertEqual(output.shape, shape)
                        np.testing.assert_array_equal(output.view(np.int32), command.view(np.int32), f"{case}, {channel}")
                    kept = outputs[len(actions):]

    def test_a_model_of_another_surface_is_refused(self):
        from smartsurf import NetworkPolicy
        from smartsurf.onnx_controller import OnnxPolicy
        path = str(self.folder / "whole.onnx")
        for planes, actions, words in ((1, 1, None), (2, 1, "its input 'observation' is 2 x 3 x 5, that of this surface 1 x 3 x 5"),
                                       (1, 2, "its output 'action' is 2 x 3 x 5, not 1 x 3 x 5")):
            layers = [(np.zeros((actions * 15, planes * 15)), np.zeros(actions * 15))]
            NetworkPolicy(layers, observation_shape=(planes, 3, 5), action_shape=(actions, 3, 5), low=0, high=1).export(path)
            policy = OnnxPolicy(path, {"proximity": 1}, ("height",))
            observation = np.zeros((1, 3, 5), np.float32)
            if words:
                with self.assertRaisesRegex(ValueError, words):
                    policy(observation, {"proximity": observation[0]})
            else:
                self.assertEqual(policy(observation, {"proximity": observation[0]})["height"].shape, (3, 5))
                other = np.zeros((1, 4, 5), np.float32)
                with self.assertRaisesRegex(ValueError, "its input 'observation' is 1 x 3 x 5, that of this surface 1 x 4 x 5"):
                    policy(other, {"proximity": other[0]})

    def test_a_policy_without_a_shape_is_refused(self):
        policy = LocalPolicy(["row"], [("height", 0, 4)], [(np.zeros((1, 1, 5)), [1])])
        with self.assertRaisesRegex(ValueError, "no inputs but row and column"):
            export_onnx(policy, self.folder / "a.onnx")


if __name__ == "__main__":
    unittest.main()
