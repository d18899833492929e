-- Leaning jets of air carry a light sheet without touching it, to where the program wants it. Run with air_jet.aps.
surface { rows = 20, columns = 20, actuator = air_jet { lean = 0.35, max_flow = 60 } }
box { size = {5, 5, 0.2}, position = {4, 4, 0.6}, mass = 1.2, colour = 'yellow', label = 'sheet' }

local low = math.huge
on_tick(function(t)
  local _, _, z = object(0):position()
  if t > 1 then low = math.min(low, z - 0.1) end
end)
on_finish(function()
  print(string.format('the sheet is at %.2f, %.2f and never came nearer than %.2f u', object(0):position(), select(2, object(0):position()), low))
end)
