-- A sphere at rest on tops that move east: it ends rolling backwards.
local truth = require 'truth'
local v, radius = option('v', 2.0), option('radius', 2.0)
truth.world {}
material { name = 'default', friction = 0.5, rolling_friction = 0, restitution = 0 }
surface { rows = 8, columns = 24, actuator = ball { radius = 0.4, max_acceleration = 1e6, top = 1 } }
local id = sphere { radius = radius, position = { 6, 3.5, radius } }
at(0, function()
  local all = {}
  for k = 1, cells.rows * cells.columns do all[k] = v / 0.4 end
  cells:targets('spin_y', all)
end)
on_finish(function()
  metric('v', truth.velocity(id)[1])
  metric('spin', truth.spin(id)[2])
end)
