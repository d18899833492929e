-- Balls of one size and two colours: blue ones belong in the western half, red ones in the eastern.
local two_kinds = require 'two_kinds'
local count = option('count', 8, 'balls of each colour', { 1, 1000 })
local n, radius = option('n', 40, 'rows and columns'), 2

material { name = 'plastic', friction = 0.25 }
surface { rows = n, columns = n, material = 'plastic', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 }, colour { range = 8 } } }

local states = {}
two_kinds.scatter(n, count, radius, function(kind, x, y)
  local id = sphere { radius = radius, material = 'plastic', colour = kind == 'east' and 'red' or 'blue', label = kind,
                      position = {x, y, 7} }
  for i = 1, count do
    local name = kind .. '_' .. i  -- east_1, west_1, …
    if not states[name] then states[name] = id break end
  end
end)
two_kinds.measure(n, count)
info(states)
episode { seconds = option('seconds', 120, 'length of an episode') }
