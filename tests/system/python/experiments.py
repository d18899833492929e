"""Scripts that the tests of the Python package share, and a base class with a folder for them."""
import os
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ["SOURCE_ROOT"])
sys.path.append(str(ROOT / "tests/system"))
from display import HAS_XVFB, Display  # noqa: E402, F401

# Draws in on_reset: Lua does not run again. Ten objects of all kinds, which roll, tumble, pile up and sleep.
CROWD = """
surface { rows = 16, columns = 16, border = { height = 6 }, actuator = pin { range = {0, 4}, max_speed = 8 },
          sensors = { proximity { range = 6 }, pressure {}, colour { range = 6 } } }
local kinds = { function(p) return sphere { radius = 0.9, position = p } end,
                function(p) return box { size = {1.6, 1.2, 1}, position = p } end,
                function(p) return cylinder { radius = 0.7, height = 1.4, position = p } end,
                function(p) return capsule { radius = 0.5, height = 1.8, position = p } end,
                function(p) return cone { radius = 0.8, height = 1.5, position = p } end }
local ids, visits, best = {}, { count = 0, last = {} }, 0
for i = 1, 10 do ids[i] = kinds[(i - 1) % 5 + 1] { 2 + i, 3 + i, 5 + i } end
on_reset(function()
  for i, id in ipairs(ids) do object(id):teleport { position = {random(3, 12), random(3, 12), 5 + 1.5 * i} } end
end)
every(0.1, function() visits.count = visits.count + random() end)
at(0.5, function() visits.last[object(3)] = true end)
on_tick(function(t)
  local x, y, z = object(ids[1]):position()
  best = math.max(best, z)
  visits[#visits + 1] = x
  if #visits > 5 then table.remove(visits, 1) end
end)
episode { seconds = 4 }
reward(function() return best + visits.count + #visits end)
success(function() local _, _, z = object(ids[1]):position() return z < 0 end)
info { first = ids[1], best = function() return best end, none = function() return nil end }
on_finish(function() metric('best', best) metric('count', visits.count) end)
"""

# Draws while it loads, has faults and noise of all kinds, and creates and removes objects while it runs.
NOISY = """
world { off_table = 'remove', gravity = -9.81 }
surface { rows = 8, columns = 10, pitch = 2, actuator = pin { range = {0, 4}, latency = 2 },
          sensors = { proximity { range = 6, noise = 0.05, drift = 0.1, latency = 2, dropout = 0.01 } } }
faults { actuator = { stuck = 0.05, weak = { fraction = 0.1, gain = 0.5 }, latency = 1 } }
for i = 1, 4 do sphere { radius = 1.2, position = {random(2, 16), random(2, 12), 6} } end
local count = 0
every(0.2, function()
  count = count + 1
  box { size = {1.5, 1.5, 1.5}, position = {random(2, 16), random(2, 12), 9}, label = 'box ' .. count }
  if count % 3 == 0 then object(count):remove() end
end)
on_tick(function(t) if t < 0.5 then object(0):push { force = {5, 0, 0}, seconds = 0.1 } end end)
reward(function() return count + #objects() end)
"""

# Episodes of different lengths, which end by success, stop and time; on_finish changes what info{} reports.
ENDINGS = """
surface { rows = 4, columns = 4, actuator = pin { range = {0, 2} }, sensors = { proximity { range = 6 } } }
local ball, limit, finished = sphere { radius = 0.8, position = {1.5, 1.5, 3} }, 0, 0
on_reset(function()
  limit = random(0.1, 0.9)
  object(ball):teleport { position = {random(1, 2), random(1, 2), 3} }
end)
episode { seconds = 0.5 }
success(function(t) return t > limit end)
on_tick(function(t) if limit < 0.3 and t > 0.15 then stop('early') end end)
reward(function(t) return t * limit end)
info { ball = ball, limit = function() return limit end, finished = function() return finished end,
       none = function() return nil end }
on_finish(function() finished = 1 metric('limit', limit) if limit > 0.5 then metric('late', 1) end end)
"""

# Ends of an episode of 1 s: name, script, and whether it succeeds.
VERDICT_SCENE = "surface { rows = 3, columns = 3, actuator = pin {} } sphere { radius = 0.3, position = {1, 1, 1} } episode { seconds = 1 }\n"
VERDICTS = (
    ("stop, true", "at(0.5, function() stop('reached', true) end)", True),
    ("stop, false", "at(0.5, function() stop('missed', false) end)", False),
    ("stop", "at(0.5, function() stop() end)", False),
    ("metric 1", "on_finish(function() metric('success', 1) end)", True),
    ("metric 0", "at(0.2, function() metric('success', 1) end) on_finish(function() metric('success', 0) end)", False),
    ("metric and stop", "metric('success', function() return 1 end) at(0.5, function() stop('no', false) end)", False),
    ("a returned time", "success(function(t) return t > 0.7 and 0.3 end)", True),
    ("at the start", "success(function(t, tick) return tick == 0 end)", True),
    ("never", "success(function() return false end)", False),
    ("error", "metric('success', function() return 0 end) at(0.5, function() error('broken') end)", False),
    ("error of success() at the end", "success(function(t) if t > 0.99 then error('broken') end end)", False),
    ("error of a metric at the end", "metric('m', function(t) if t > 0.99 then error('broken') end end)", False),
    ("error of on_finish", "on_finish(function() error('broken') end)", False),
    ("error of on_finish after stop", "at(0.5, function() stop('reached', true) end) on_finish(function() error('broken') end)", True),
    ("error after success", "success(function(t) return t > 0.2 end) at(0.5, function() error('broken') end)", True),
)

ACTUATORS = {
    "wheels": "wheels { top = 0.8, max_spin = 20 }", "ball": "ball { radius = 0.4, max_spin = 20 }",
    "rotor": "rotor {}", "force_field": "force_field { max_force = 4, reach = 1 }",
    "magnet": "magnet { strength = 50 }", "air_jet": "air_jet { max_flow = 30 }",
    "tile": "tile { frequency = 8 }", "delta": "delta { workspace = { z = {1, 2} }, stiffness = 100 }", "pin": "pin { range = {0, 2}, max_force = 30 }",
}

TASK_OF_EACH_ACTUATOR = """
surface { rows = 8, columns = 8, actuator = %s, sensors = { proximity { range = 4 } } }
box { size = {2.4, 2.4, 0.6}, position = {3.5, 3.5, 2}, pole = 1, mass = 1 }
sphere { radius = 0.8, position = {5, 5, 5} }
"""


class ExperimentTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def script(self, text, name="experiment.lua"):
        path = self.folder / name
        path.write_text(text)
        return str(path)
