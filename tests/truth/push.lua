-- A force through the centre of one box, a couple on another.
local truth = require 'truth'
local force, mass = option('force', 4.0), option('mass', 2.0)
truth.world { gravity = 0 }
surface { rows = 4, columns = 4, actuator = pin {} }
local a = box { size = { 1, 1, 1 }, mass = mass, position = { 0, 0, 5 } }
local b = box { size = { 1, 1, 1 }, mass = mass, position = { 0, 0, 10 } }
on_tick(function()
  object(a):push { force = { force, 0, 0 } }
  object(b):push { force = { 0, force, 0 }, point = { 0.5, 0, 10 } }
  object(b):push { force = { 0, -force, 0 }, point = { -0.5, 0, 10 } }
end)
on_finish(function()
  metric('v', truth.velocity(a)[1])
  metric('x', truth.position(a)[1])
  metric('spin', truth.spin(b)[3])
end)
