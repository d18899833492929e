-- Spheres in the pockets of a table whose pins heave under them: what scripts/bench draws in a window.
local cells_a_side = option('cells', 64, 'rows and columns of the table')
local count = option('count', 500, 'number of spheres')

world { seed = 1 }

surface { rows = cells_a_side, columns = cells_a_side,
          actuator = pin { range = { 0, 6 }, max_speed = 20 },
          sensors  = { proximity { range = 8 } },
          border   = { height = 8 } }

local across = math.floor((cells_a_side - 4) / 2.6)
for i = 0, count - 1 do
  local layer, place = i // (across * across), i % (across * across)
  local small = i % 3 > 0
  sphere { radius = small and 0.9 or 1.2, colour = small and 'blue' or 'orange', label = small and 'small' or 'large',
           position = { 2.5 + 2.6 * (place % across), 2.5 + 2.6 * (place // across), 7 + 2.6 * layer } }
end
