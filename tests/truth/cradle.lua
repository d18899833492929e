-- One sphere hits a row of resting spheres, `gap` apart, without gravity and friction.
local truth = require 'truth'
local n, e, gap, v = option('n', 6), option('e', 1.0), option('gap', 0.0), option('v', 1.0)
truth.world { gravity = 0, sleep = false }
material { name = 'default', friction = 0, restitution = e }
surface { rows = 8, columns = 24, actuator = pin {} }
local ids = { sphere { radius = 0.5, position = { 0, 3, 20 }, velocity = { v, 0, 0 } } }
for i = 2, n do ids[i] = sphere { radius = 0.5, position = { 1.2 + (i - 2) * (1 + gap), 3, 20 } } end
on_finish(function()
  local sum, energy = 0, 0
  for i, id in ipairs(ids) do
    local u = truth.velocity(id)[1]
    sum, energy = sum + u, energy + u ^ 2
    metric('v' .. i, u)
  end
  metric('last', truth.velocity(ids[n])[1])
  metric('first', truth.velocity(ids[1])[1])
  metric('momentum', sum / v)
  metric('energy', energy / v ^ 2)
end)
