-- Balls of two sizes, as in the case study: small ones belong in the western half, large ones in the eastern.
local two_kinds = require 'two_kinds'
local count = option('count', 20, 'balls of each size', { 1, 1000 })
local n = option('n', 64, 'rows and columns')
local stuck = option('stuck', 0.0, 'share of the pins that stand still at a height of their own')
local dead = option('dead', 0.0, 'share of the pins that stay down')

material { name = 'plastic', friction = 0.25 }
surface { rows = n, columns = n, material = 'plastic', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 } } }
faults { actuator = { stuck = stuck, dead = dead } }

two_kinds.scatter(n, count, 4, function(kind, x, y)
  local large = kind == 'east'
  sphere { radius = large and 4 or 2, material = 'plastic', colour = large and '#d55e00' or '#0072b2', label = kind,
           position = {x, y, large and 9 or 7} }
end)
two_kinds.measure(n, count)
episode { seconds = 240 }
