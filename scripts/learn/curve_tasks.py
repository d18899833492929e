"""The tasks of scripts/learn/curves: small, randomised, without a success that ends an episode, so that returns can be compared."""
import numpy as np
import smartsurf


class Wheels(smartsurf.Task):
    """A box on a table of wheels is to come to the middle (docs/first-policy.md)."""
    scene = """
        surface { rows = 10, columns = 10, actuator = wheels { top = 0.8, max_spin = 20 },
                  sensors = { proximity { range = 4 } }, border = { height = 1.5 } }
        box { size = {3, 2, 1}, position = {4.5, 4.5, 0.6}, label = 'box' }"""
    episode_seconds = 3
    randomise = {"object.box.position": ((2, 2, 0.6), (7, 7, 0.6)), "object.box.yaw": (-np.pi, np.pi),
                 "object.box.mass": (5, 30), "object.box.friction": (0.4, 0.9), "faults.actuator.dead": (0, 0.05)}

    def reward(self, state):
        return -np.linalg.norm(state.position("box")[:, :2] - 4.5, axis=1)


class Plate(smartsurf.Task):
    """A moving ball on a plate of pins is to come to the middle and stay."""
    scene = """
        surface { rows = 10, columns = 10, actuator = pin { range = {0, 2}, max_speed = 6, max_acceleration = 60 },
                  sensors = { proximity { range = 4 } }, border = { height = 4 } }
        sphere { radius = 1, position = {4.5, 4.5, 2}, label = 'ball' }"""
    episode_seconds = 4
    randomise = {"object.ball.position": ((2, 2, 2.5), (7, 7, 2.5)), "object.ball.velocity": ((-2, -2, 0), (2, 2, 0)),
                 "object.ball.mass": (2, 8), "surface.friction": (0.3, 0.8)}

    def reward(self, state):
        return -np.linalg.norm(state.position("ball")[:, :2] - 4.5, axis=1)
