-- A round body rolls down a slope from rest; cells without gaps (`top` = 1) are a plane.
local truth = require 'truth'
local shape, angle, top, radius = option('shape', 'sphere'), option('angle', 5.0), option('top', 1.0), option('radius', 1.5)
truth.world { gravity = truth.slope(angle) }
material { name = 'default', friction = 0.5, rolling_friction = 0, restitution = 0 }
surface { rows = 16, columns = 48, actuator = pin { top = top } }
local lying = { axis = { 1, 0, 0 }, angle = math.pi / 2 }
local position = { 3, 7.3, radius }
local id
if shape == 'sphere' then id = sphere { radius = radius, position = position }
elseif shape == 'cylinder' then id = cylinder { radius = radius, height = 4, position = position, orientation = lying }
else id = capsule { radius = radius, height = 4 + 2 * radius, position = position, orientation = lying } end
local highest = 0
truth.sample(function() highest = math.max(highest, truth.position(id)[3]) end)
on_finish(function()
  metric('distance', truth.position(id)[1] - 3)
  metric('aside', truth.position(id)[2] - 7.3)
  metric('slip', truth.velocity(id)[1] - radius * truth.spin(id)[2])
  metric('hop', highest - radius)
end)
