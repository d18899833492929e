-- Jets of air tell two kinds of sheet apart and carry each to its own region, without touching it. Run with air_types.aps.
surface { rows = 20, columns = 30, actuator = air_jet { lean = 0.35, max_flow = 60 }, sensors = { object_type {} } }
local function sheet(label, colour, x, y)
  return box { size = { 5, 5, 0.2 }, position = { x, y, 0.6 }, mass = 1.2, colour = colour, label = label }
end
local letter, card = sheet('letter', 'yellow', 11, 5), sheet('card', 'blue', 18, 14)

local low = math.huge
on_tick(function(t)
  for _, id in ipairs { letter, card } do
    local _, _, z = object(id):position()
    if t > 1 then low = math.min(low, z - 0.1) end
  end
end)
on_finish(function()
  local function say(id) print(string.format('the %s is at %.2f, %.2f', object(id):label(), object(id):position())) end
  say(letter)
  say(card)
  print(string.format('neither came nearer than %.2f u', low))
end)
