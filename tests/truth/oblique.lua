-- A sphere bounces obliquely off level cells.
local truth = require 'truth'
local mu, e, vx, vz, spin = option('mu', 0.3), option('e', 1.0), option('vx', 8.0), option('vz', 4.43), option('spin', 0.0)
truth.world { gravity = 0 }
material { name = 'default', friction = mu, rolling_friction = 0, restitution = e }
surface { rows = 8, columns = 40, actuator = pin { top = 1 } }
local id = sphere { radius = 1, position = { 6.3, 3.2, 2.013 }, velocity = { vx, 0, -vz }, angular_velocity = { 0, spin, 0 } }
on_finish(function()
  local v, w = truth.velocity(id), truth.spin(id)
  metric('vx', v[1])
  metric('vz', v[3])
  metric('spin', w[2])
end)
