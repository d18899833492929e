-- A sphere at rest: how deep it sinks, what its cell bears. `unit` scales all lengths.
local truth = require 'truth'
local unit, radius = option('unit', 1.0), option('radius', 2.0)
truth.world { gravity = -truth.g * unit }
surface { rows = 8, columns = 8, pitch = unit, sensors = { pressure {} },
          actuator = pin { top = 0.8 * unit, length = 2 * unit, range = { 0, 6 * unit } } }
local mass = 3
local id = sphere { radius = radius * unit, mass = mass, position = { 3 * unit, 3 * unit, radius * unit } }
local deepest, total, ticks = 0, 0, 0
truth.sample(function(t)
  deepest = math.max(deepest, radius * unit - truth.position(id)[3])
  if t > 1 then total, ticks = total + truth.load(), ticks + 1 end
end)
on_finish(function()
  metric('depth', deepest / (radius * unit))
  metric('load', total / ticks / unit)
end)
