-- A box on four compliant tips swings from where it just touches them.
local truth = require 'truth'
local stiffness, damping, mass = option('stiffness', 200.0), option('damping', 0.36), option('mass', 2.0)
truth.world {}
material { name = 'default', friction = 0.5, restitution = 0 }
surface { rows = 2, columns = 2, actuator = delta { tip = { radius = 0.25 }, workspace = { radius = 0.5, z = { 0, 2 } },
          arms = { length = 3, radius = 1 }, stiffness = stiffness / 4, damping = damping / 4, max_force = 1000 } }
local id = box { size = { 1.6, 1.6, 1 }, mass = mass, position = { 0.5, 0.5, 0.5 } }
local swing = truth.swing(function() return truth.position(id)[3] end)
on_finish(function()
  metric('decrement', swing.decrement())
  metric('period', swing.period())
end)
