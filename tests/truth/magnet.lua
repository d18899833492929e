-- One coil and a body on its axis, without gravity: the speed that the field gives it between two heights.
local truth = require 'truth'
local law, k, current, charge, start, finish = option('law', 'pole'), option('k', 100.0), option('current', 1.0),
                                               option('charge', 1.0), option('start', 3.0), option('finish', 5.0)
truth.world { gravity = 0 }
surface { rows = 1, columns = 1, actuator = magnet { law = law, strength = k, depth = 1, reach = 6, lag = 0 } }
local fields = { radius = 0.2, mass = 1, position = { 0, 0, start - 1 } }
if law == 'pole' then fields.pole = charge else fields.moment = { 0, 0, charge } end
local id = sphere(fields)
at(0, function() cells:target('current', 1, 1, current) end)
local before, speed
truth.sample(function()
  local z, v = truth.position(id)[3] + 1, truth.velocity(id)[3]
  if before and not speed and (before[1] - finish) * (z - finish) <= 0 then
    speed = before[2] + (v - before[2]) * (finish - before[1]) / (z - before[1])
  end
  before = { z, v }
end)
on_finish(function() metric('v', speed or 0) end)
