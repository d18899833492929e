"""A surface as an environment for learning: reset(seed), step(action), spaces; Gymnasium-compatible, but without
needing Gymnasium."""
import os
import subprocess
import tempfile
import uuid
import weakref

import numpy as np

from ._controller import Controller

try:
    import gymnasium as _gymnasium
    _Base = _gymnasium.Env
    Box, Dict = _gymnasium.spaces.Box, _gymnasium.spaces.Dict
except ImportError:
    _Base = object

    class Box:
        """The subset of gymnasium.spaces.Box that is used here."""

        def __init__(self, low, high, shape, dtype=np.float32, seed=None):
            self.low, self.high = np.full(shape, low, dtype), np.full(shape, high, dtype)
            self.shape, self.dtype = tuple(shape), np.dtype(dtype)
            self.seed(seed)

        def __repr__(self):
            return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"

        def seed(self, seed=None):
            self._random = np.random.default_rng(seed)

        def sample(self):
            if self.dtype.kind == "u":
                return self._random.integers(self.low, self.high, endpoint=True, dtype=self.dtype)
            # In float64: the width of the float32 range overflows float32.
            low, high = self.low.astype(np.float64), self.high.astype(np.float64)
            return np.clip((low + (high - low) * self._random.random(self.shape)).astype(self.dtype), self.low, self.high)

        def contains(self, x):
            x = np.asarray(x)
            return x.shape == self.shape and np.can_cast(x.dtype, self.dtype) and bool(
                np.all((x >= self.low) & (x <= self.high)))

    class Dict(dict):
        """The subset of gymnasium.spaces.Dict that is used here."""

        def seed(self, seed=None):
            for i, space in enumerate(self.values()):
                space.seed(None if seed is None else seed + i)

        def sample(self):
            return {name: space.sample() for name, space in self.items()}

        def contains(self, x):
            return isinstance(x, dict) and x.keys() == self.keys() and all(
                space.contains(x[name]) for name, space in self.items())


def _space(channels, description):
    def box(channel):
        shape = (description.rows, description.columns)
        if channel.components > 1:
            shape = (channel.components, *shape)
        return Box(channel.minimum, channel.maximum, shape, channel.dtype.type)
    return Dict({c.name: box(c) for c in channels})


def _end(process, says, owner):
    """Ends the simulator. A copy of the environment in a forked child does nothing."""
    if os.getpid() != owner:
        return
    process.terminate()
    try:
        process.wait(5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    says.close()


class SurfaceEnv(_Base):
    """One controller of one surface.

    SurfaceEnv(experiment="sort.lua") starts `smartsurf run sort.lua --shm NAME` at each reset and ends it at the
    next, or at close(). What it says on stderr is kept back; when it fails, RuntimeError tells its last line.
    SurfaceEnv(name="table") attaches to a surface that somebody else runs, hardware for one; that cannot be reset to a
    seed.

    An observation is a dict of sensor arrays (copies), an action a dict of actuator arrays, or one array where there
    is a single actuator channel. reward(observation, action) → float and done(observation) → bool are the task.
    """
    metadata = {"render_modes": []}
    render_mode = None

    def __init__(self, experiment=None, name=None, reward=None, done=None, max_steps=None, options=None,
                 smartsurf="smartsurf", arguments=(), timeout=30.0):
        if (experiment is None) == (name is None):
            raise ValueError("either an experiment to start, or the name of a running surface")
        self._experiment, self._name = experiment, name
        self._reward, self._done = reward or (lambda observation, action: 0.0), done or (lambda observation: False)
        self._max_steps, self._timeout = max_steps, timeout
        self._command = [smartsurf, "run", str(experiment), *map(str, arguments)]
        for key, value in (options or {}).items():
            self._command += ["--set", f"{key}={value}"]
        self._process, self.controller, self._steps = None, None, 0
        self._ready = False  # the first observation is available and not returned by a reset() yet
        self._start(None)
        d = self.controller.description
        self.observation_space = _space([c for c in d.channels if c.direction == "sensor"], d)
        self.action_space = _space([c for c in d.channels if c.direction == "actuator"], d)

    def _start(self, seed):
        name = self._name
        if self._experiment is not None:
            name = f"env-{os.getpid()}-{uuid.uuid4().hex[:8]}"
            command = self._command + ["--shm", name] + ([] if seed is None else ["--seed", str(seed)])
            self._says = tempfile.TemporaryFile()
            try:
                # The simulator ends with this process, even if it is killed.
                self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=self._says,
                                                 env={**os.environ, "SMARTSURF_PARENT": str(os.getpid())})
                self._finalizer = weakref.finalize(self, _end, self._process, self._says, os.getpid())
            except OSError as e:
                self._says.close()
                raise RuntimeError(f"cannot start {command[0]} ({e.strerror}): put it on PATH, or name it with "
                                   "smartsurf='FOLDER/smartsurf'") from None
        try:
            self.controller = self._attach(name)
            self._next("the surface closed before its first frame")
        except BaseException:
            self._stop()
            raise
        self._ready = True

    def _attach(self, name):
        """Attaches; raises if the simulator ends because of an error in the experiment."""
        left = self._timeout
        while True:
            try:
                return Controller(name, timeout=min(0.25, left))
            except Exception as e:
                left -= 0.25
                if getattr(e, "result", None) != -3 or left <= 0:
                    raise
                if self._process is not None and self._process.poll() is not None:
                    raise self._failure("before there was a surface") from None

    def _failure(self, when):
        self._says.seek(0)
        lines = self._says.read().decode(errors="replace").strip().splitlines()
        return RuntimeError(f"{' '.join(self._command)} ended with status {self._process.returncode} {when}"
                            + (f": {lines[-1]}" if lines else ""))

    def _next(self, what):
        if not self.controller.wait(self._timeout):
            raise RuntimeError(what)

    def _stop(self):
        if self.controller is not None:
            self.controller.close()
            self.controller = None
        if self._process is not None:
            self._finalizer()
            self._process = None

    def reset(self, *, seed=None, options=None):
        """→ observation, info. With an experiment the simulator restarts, with this seed if given."""
        if self._experiment is None:
            if seed is not None:
                raise ValueError("this surface was not started by the environment: it cannot be reset to a seed")
        elif seed is not None or not self._ready:
            self._stop()
            self._start(seed)
        self._ready, self._steps = False, 0
        return self._observation(), self._info()

    def step(self, action):
        """→ observation, reward, terminated, truncated, info. terminated: done() is true, or the surface closed in an
        orderly way. Raises RuntimeError when the simulator failed."""
        if self.controller is None:
            raise RuntimeError("reset() first")
        self._write(action)
        self._ready = False
        self.controller.publish()
        closed = not self.controller.wait(self._timeout)
        if closed and self._process is not None and self._process.wait(self._timeout) != 0:
            raise self._failure(f"after {self._steps} steps")
        self._steps += 1
        observation = self._last if closed else self._observation()
        terminated = closed or bool(self._done(observation))
        truncated = not terminated and self._max_steps is not None and self._steps >= self._max_steps
        info = dict(self._info(), surface_closed=closed)
        return observation, float(self._reward(observation, action)), terminated, truncated, info

    def _write(self, action):
        arrays = self.controller.actuators
        if not isinstance(action, dict):
            if len(arrays) != 1:
                raise ValueError(f"an action must be a dict of {', '.join(arrays)}")
            action = {next(iter(arrays)): action}
        if action.keys() != set(arrays):
            raise ValueError(f"an action must have the channels {', '.join(arrays)}, not {', '.join(action)}")
        for name, values in action.items():
            array = arrays[name]
            try:
                array[...] = values
            except (TypeError, ValueError):
                what = f"shape {np.shape(values)}" if isinstance(values, np.ndarray) else f"{values!r:.60}"
                raise ValueError(f"the action's {name} must be numbers of shape {array.shape}, not {what}") from None

    def _observation(self):
        self._last = self.controller.sensors.copies()
        return self._last

    def _info(self):
        frame = self.controller.frame
        return {"tick": frame.tick, "time": frame.time}

    def close(self):
        self._stop()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
