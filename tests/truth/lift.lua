-- All pins rise along their motion profile; a box on them follows. `stop`: at a deceleration above g the box flies.
local truth = require 'truth'
local height, speed, acceleration = option('height', 4.0), option('speed', 2.0), option('acceleration', 5.0)
local shape = option('shape', 'box')
truth.world {}
material { name = 'default', friction = 0.5, restitution = 0 }
surface { rows = 8, columns = 8, actuator = pin { max_speed = speed, max_acceleration = acceleration } }
local id
if shape == 'box' then id = box { size = { 2, 2, 2 }, position = { 3.3, 3.2, 1 } }
else id = sphere { radius = 1, position = { 3.3, 3.2, 1 } } end
at(0, function()
  local all = {}
  for k = 1, 64 do all[k] = height end
  cells:targets('height', all)
end)
local apex, at_1 = 0, nil
truth.sample(function(t)
  local z = truth.position(id)[3] - 1
  apex = math.max(apex, z)
  if t <= 1 + 1e-9 then at_1 = z end
end)
on_finish(function()
  metric('apex', apex - height)
  metric('at_1', at_1)
  metric('end', truth.position(id)[3] - 1)
end)
