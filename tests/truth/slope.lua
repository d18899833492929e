-- A box on a slope from rest.
local truth = require 'truth'
local mu, angle = option('mu', 0.3), option('angle', 25.0)
truth.world { gravity = truth.slope(angle) }
material { name = 'default', friction = mu, restitution = 0 }
surface { rows = 12, columns = 48, actuator = pin {} }
local id = box { size = { 3, 3, 1 }, position = { 4, 5.3, 0.5 } }
on_finish(function()
  metric('distance', truth.position(id)[1] - 4)
  metric('v', truth.velocity(id)[1])
end)
