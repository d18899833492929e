-- A sphere hits the face of a free box beside its centre, without friction.
local truth = require 'truth'
local e, v, lever = option('e', 0.5), option('v', 4.0), option('lever', 0.8)
truth.world { gravity = 0, sleep = false }
material { name = 'default', friction = 0, restitution = e }
surface { rows = 8, columns = 8, actuator = pin {} }
local a = sphere { radius = 0.5, mass = 1, position = { 0, lever, 20 }, velocity = { v, 0, 0 } }
local b = box { size = { 1, 2.4, 1 }, mass = 2, position = { 2.013, 0, 20 } }
on_finish(function()
  metric('v1', truth.velocity(a)[1])
  metric('v2', truth.velocity(b)[1])
  metric('spin', truth.spin(b)[3])
end)
