-- Boxes on each other: one of `ratio` on four of mass 1, or five whose masses grow upwards to `ratio` by equal factors.
local truth = require 'truth'
local ratio, growing, n = option('ratio', 1000.0), option('growing', false), option('n', 5)
truth.world { iterations = option('iterations', 10) }
material { name = 'default', friction = 0.5 }
surface { rows = 8, columns = 8, actuator = pin { top = 1 } }
local ids = {}
for i = 1, n do
  local mass = growing and ratio ^ ((i - 1) / (n - 1)) or i == n and ratio or 1
  ids[i] = box { size = { 2, 2, 1 }, mass = mass, position = { 3.5, 3.5, i - 0.5 } }
end
local speed = 0
truth.sample(function(t)
  if t < 8 then return end
  for _, id in ipairs(ids) do speed = math.max(speed, truth.norm(truth.velocity(id))) end
end)
on_finish(function()
  metric('sink', n - 0.5 - truth.position(ids[n])[3])
  metric('speed', speed)
end)
