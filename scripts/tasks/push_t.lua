-- Push-T: a T on 32×32 two-wheel cells is to cover its goal, turned by −45° in the middle, from anywhere and
-- however it is turned.
local side = 32
surface { rows = side, columns = side, border = { height = 3 },
          actuator = wheels { radius = 0.4, max_spin = 15 }, sensors = { proximity { range = 3 } } }
require 'tee' { side = side, goal = { x = (side - 1) / 2, y = (side - 1) / 2, yaw = -math.pi / 4 }, seconds = 25 }
