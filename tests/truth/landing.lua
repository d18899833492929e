-- A box is dropped flat on a box that rests on the table, a little beside its middle, without restitution: it stays flat,
-- because its middle is over the lower box.
local truth = require 'truth'
local beside, along, height = option('beside', 0.1), option('along', 0.0), option('height', 7.5)
truth.world {}
material { name = 'default', friction = 0.5, restitution = 0 }
surface { rows = 12, columns = 12, actuator = pin { top = 1 } }
box { size = { 2, 2, 2 }, position = { 5.5, 5.5, 1 } }
local id = box { size = { 2, 2, 2 }, position = { 5.5 + beside, 5.5 + along, height } }
local tilt, spin = 0, 0
truth.sample(function(t)
  tilt = math.max(tilt, math.deg(math.acos(math.min(1, truth.rotate(id, { 0, 0, 1 })[3]))))
  spin = math.max(spin, truth.norm(truth.spin(id)))
end)
on_finish(function()
  metric('tilt', tilt)
  metric('spin', spin)
end)
