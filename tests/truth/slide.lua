-- A box slides to rest on level cells. `unit` scales all lengths, as another unit of length does.
local truth = require 'truth'
local mu, v, heading, unit = option('mu', 0.5), option('v', 8.0), math.rad(option('heading', 0.0)), option('unit', 1.0)
truth.world { gravity = -truth.g * unit }
material { name = 'default', friction = mu, rolling_friction = 0, restitution = 0 }
surface { rows = 32, columns = 32, pitch = unit, actuator = pin { top = 0.8 * unit, length = 2 * unit, range = { 0, 6 * unit } } }
local start = { 10 * unit, 10.3 * unit }
local id = box { size = { 3 * unit, 3 * unit, unit }, position = { start[1], start[2], 0.5 * unit },
                 velocity = { v * unit * math.cos(heading), v * unit * math.sin(heading), 0 } }
local stop_at = 0
truth.sample(function(t)
  if truth.norm(truth.velocity(id)) > 0.01 * v * unit then stop_at = t end
end)
on_finish(function()
  local p = truth.position(id)
  local x, y = p[1] - start[1], p[2] - start[2]
  metric('distance', math.sqrt(x ^ 2 + y ^ 2) / unit)
  metric('aside', (math.cos(heading) * y - math.sin(heading) * x) / unit)
  metric('stops', stop_at)
  metric('turned', math.deg(2 * math.asin(math.min(1, math.abs(select(3, object(id):orientation()))))))
end)
