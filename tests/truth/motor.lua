-- Nine pins of limited force under a box of `share` of what they bear: it rises, or stays; raised pins sink with it.
local truth = require 'truth'
local share, raised, force, speed = option('share', 0.5), option('raised', false), option('force', 40.0), option('speed', 2.0)
truth.world {}
material { name = 'default', friction = 0.5, restitution = 0 }
surface { rows = 12, columns = 12,
          actuator = pin { range = { 0, 6 }, max_speed = speed, max_acceleration = 10, max_force = force } }
local z0 = raised and 6 or 0
local id = box { size = { 2.8, 2.8, 1 }, mass = share * 9 * force / truth.g, position = { 6, 6, raised and 300.5 or 0.5 } }
at(0, function()
  local all = {}
  for k = 1, 144 do all[k] = 6 end
  cells:targets('height', all)
end)
if raised then at(5, function() object(id):teleport { position = { 6, 6, 6.5 }, velocity = { 0, 0, 0 } } end) end
local at_1
truth.sample(function(t)
  if t <= 1 + 1e-9 then at_1 = truth.position(id)[3] end
end)
on_finish(function()
  metric('v', truth.velocity(id)[3])
  metric('rise', truth.position(id)[3] - 0.5 - z0)
  metric('speed', truth.position(id)[3] - at_1)
end)
