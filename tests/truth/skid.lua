-- A sphere that slips on level cells until it rolls.
local truth = require 'truth'
local v, spin, mu, radius = option('v', 7.0), option('spin', 0.0), option('mu', 0.5), option('radius', 1.0)
truth.world {}
material { name = 'default', friction = mu, rolling_friction = 0, restitution = 0 }
surface { rows = 8, columns = 48, actuator = pin { top = 1 } }
local id = sphere { radius = radius, position = { 8, 3.3, radius }, velocity = { v, 0, 0 }, angular_velocity = { 0, spin, 0 } }
local slipped = 0
truth.sample(function(t)
  if math.abs(truth.velocity(id)[1] - radius * truth.spin(id)[2]) > 0.01 * math.abs(v - radius * spin) then slipped = t end
end)
on_finish(function()
  metric('v', truth.velocity(id)[1])
  metric('spin', truth.spin(id)[2])
  metric('slips', slipped)
end)
