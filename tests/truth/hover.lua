-- A sheet hovers over air jets.
local truth = require 'truth'
local flow, mass = option('flow', 50.0), option('mass', 1.0)
truth.world {}
surface { rows = 12, columns = 12, actuator = air_jet { decay = 2, lag = 0 } }
local id = box { size = { 4.8, 4.8, 0.2 }, mass = mass, position = { 6, 6, 1.5 } }
at(0, function()
  local all = {}
  for k = 1, 144 do all[k] = flow end
  cells:targets('flow', all)
end)
on_finish(function() metric('gap', truth.position(id)[3] - 0.1) end)
