-- A sphere in free flight.
local truth = require 'truth'
local vx, vz = option('vx', 0.0), option('vz', 0.0)
truth.world {}
surface { rows = 4, columns = 4, actuator = pin {} }
local id = sphere { radius = 0.5, position = { 1, 1, 60 }, velocity = { vx, 0, vz } }
on_finish(function()
  local p, v = truth.position(id), truth.velocity(id)
  metric('x', p[1] - 1)
  metric('z', p[3] - 60)
  metric('vz', v[3])
end)
