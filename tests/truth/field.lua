-- Nine cells of a force field act on a box: along x on frictionless cells, or upward against its weight.
local truth = require 'truth'
local fx, mass, lift, reach = option('fx', 2.0), option('mass', 60.0), option('lift', false), option('reach', 1.0)
truth.world {}
material { name = 'default', friction = 0, restitution = 0 }
surface { rows = 12, columns = 24,
          actuator = force_field { fall_off = lift and 'linear' or 'flat', reach = reach, max_force = 1000 } }
-- Two thirds of the reach above the cells each cell's force is a third of its strength.
local id = box { size = { 2.9, 2.9, 1 }, mass = mass, position = { 6, 6, 0.5 + (lift and reach * 2 / 3 + 0.02 or 0) } }
at(0, function()
  for r = 1, 12 do
    for c = 1, 24 do
      if lift then cells:target('fz', r, c, 3 * mass * truth.g / 9) else cells:target('fx', r, c, fx) end
    end
  end
end)
local before, crossings, first, last = nil, 0, 0, 0
truth.sample(function(t)
  local z = truth.position(id)[3] - 0.5 - reach * 2 / 3
  if before and (before < 0) ~= (z < 0) then
    local at = t - truth.dt * z / (z - before)
    crossings, last = crossings + 1, at
    if crossings == 1 then first = at end
  end
  before = z
end)
on_finish(function()
  metric('v', truth.velocity(id)[1])
  metric('x', truth.position(id)[1] - 6)
  metric('period', crossings > 1 and 2 * (last - first) / (crossings - 1) or 0)
end)
