-- A ball on pins of limited force that are told to stand at `height`; none is overloaded.
local truth = require 'truth'
local g, force, speed, height = option('g', 9.81), option('force', 1000.0), option('speed', 0.5), option('height', 2.0)
local x = option('x', 7.0)
truth.world { gravity = -g }
surface { rows = 16, columns = 16,
          actuator = pin { range = { 0, 6 }, max_speed = speed, max_acceleration = 5, max_force = force } }
local radius = 3
local id = sphere { radius = radius, mass = 10, position = { x, x, radius } }
at(0, function()
  local all = {}
  for k = 1, 256 do all[k] = height end
  cells:targets('height', all)
end)
local lowest = 100
truth.sample(function() lowest = math.min(lowest, truth.position(id)[3]) end)
on_finish(function()
  metric('z', truth.position(id)[3])
  metric('lowest', lowest - radius)
end)
