-- Flat parts on rolling balls, turned anyhow: bars belong in the western half, plates in the eastern.
local two_kinds = require 'two_kinds'
local count = option('count', 6, 'parts of each kind', { 1, 1000 })
local n = option('n', 40, 'rows and columns')

surface { rows = n, columns = n, border = { height = 3 }, actuator = ball { radius = 0.4, max_spin = 20 },
          sensors = { proximity { range = 4 } } }

two_kinds.scatter(n, count, 4, function(kind, x, y)
  local plate = kind == 'east'
  box { size = plate and { 4.4, 4.4, 1 } or { 7.5, 1.8, 1 }, colour = plate and 'orange' or 'purple', label = kind,
        position = { x, y, 0.6 }, orientation = { yaw = random(0, math.pi) } }
end)
two_kinds.measure(n, count)
episode { seconds = 120 }
