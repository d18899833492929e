-- Two spheres without gravity and friction; the first moves east and hits the second off its line by `offset` · 2r.
local truth = require 'truth'
local e, m, offset, v = option('e', 1.0), option('m', 1.0), option('offset', 0.0), option('v', 4.0)
truth.world { gravity = 0, sleep = false }
material { name = 'default', friction = 0, restitution = e }
surface { rows = 8, columns = 8, actuator = pin {} }
local a = sphere { radius = 0.5, mass = 1, position = { 0, 0, 20 }, velocity = { v, 0, 0 } }
local b = sphere { radius = 0.5, mass = m, position = { 2.013, offset, 20 } }
on_finish(function()
  local u, w = truth.velocity(a), truth.velocity(b)
  metric('v1', u[1])
  metric('v2', w[1])
  metric('v2y', w[2])
  metric('speed2', truth.norm(w))
end)
