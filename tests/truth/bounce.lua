-- Spheres fall from eight heights and bounce once: the mean of the ratios of the heights.
local truth = require 'truth'
local e = option('e', 0.8)
truth.world {}
material { name = 'default', friction = 0.5, restitution = e }
surface { rows = 8, columns = 40, actuator = pin {} }
local ids, drop, apex, rises = {}, {}, {}, {}
for i = 1, 8 do
  drop[i] = 3 + 0.17 * i
  ids[i] = sphere { radius = 1, position = { 4.3 * i, 3.2, 1 + drop[i] } }
  apex[i], rises[i] = 0, false
end
truth.sample(function()
  for i, id in ipairs(ids) do
    if truth.velocity(id)[3] > 0 then rises[i] = true end
    if rises[i] then apex[i] = math.max(apex[i], truth.position(id)[3] - 1) end
  end
end)
on_finish(function()
  local sum, worst = 0, 0
  for i = 1, 8 do
    sum = sum + apex[i] / drop[i]
    worst = math.max(worst, math.abs(apex[i] / drop[i] - e ^ 2))
  end
  metric('ratio', sum / 8)
  metric('worst', worst)
end)
