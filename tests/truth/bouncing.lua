-- A perfectly elastic ball bounces for a minute.
local truth = require 'truth'
truth.world {}
material { name = 'default', friction = 0.5, restitution = 1 }
surface { rows = 8, columns = 8, actuator = pin {} }
local id = sphere { radius = 1, position = { 3.3, 3.2, 4 } }
local bounces, before = 0, 0
truth.sample(function()
  local v = truth.velocity(id)[3]
  if before < 0 and v > 0 then bounces = bounces + 1 end
  before = v
end)
on_finish(function()
  local v, p = truth.velocity(id), truth.position(id)
  metric('energy', (truth.dot(v, v) / 2 + truth.g * (p[3] - 1)) / (truth.g * 3))
  metric('bounces', bounces)
end)
