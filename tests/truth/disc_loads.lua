-- A cylinder upright on level cells: radius 2.2 about a cell's centre reaches 21 cells, which bear equal loads.
local truth = require 'truth'
local mass = option('mass', 21.0)
truth.world { sleep = option('sleep', false) }
surface { rows = 9, columns = 9, actuator = pin {}, sensors = { pressure {} } }
local id = cylinder { radius = 2.2, height = 1, mass = mass, position = { 4, 4, 0.5 } }
local sums, ticks = {}, 0
truth.sample(function(t)
  if t < 1 then return end
  ticks = ticks + 1
  for i = 1, 81 do sums[i] = (sums[i] or 0) + cells:truth('pressure', (i - 1) // 9 + 1, (i - 1) % 9 + 1) end
end)
on_finish(function()
  local total, worst = 0, 0
  for i = 1, 81 do
    local load, x, y = sums[i] / ticks, (i - 1) % 9 - 4, (i - 1) // 9 - 4
    local inside = math.max(math.abs(x), math.abs(y)) <= 2 and math.abs(x) + math.abs(y) < 4
    total = total + load
    worst = math.max(worst, math.abs(load - (inside and mass * truth.g / 21 or 0)))
  end
  metric('load', total)
  metric('worst', worst * 21 / (mass * truth.g))
end)
