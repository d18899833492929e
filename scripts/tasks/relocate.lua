-- One ball anywhere on a 16×16 table is to lie at the goal, column 11 and row 10 from the north-west, counted from 0.
local stuck = option('stuck', 0.0, 'share of the pins that stand still at a height of their own')
local dead = option('dead', 0.0, 'share of the pins that stay down')
local goal_x, goal_y = 11, 15 - 10

material { name = 'felt', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 16, columns = 16, material = 'felt', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 } } }
faults { actuator = { stuck = stuck, dead = dead } }
sphere { radius = 1.5, position = { random(3, 12), random(3, 12), 8 }, colour = 'orange', material = 'felt' }

local within
local function error_u()
  local x, y = object(0):position()
  return math.sqrt((x - goal_x)^2 + (y - goal_y)^2)
end
on_tick(function(t) within = error_u() < 0.5 and object(0):on_table() and (within or t) or nil end)
on_finish(function()
  metric('error_u', error_u())
  metric('success', within and 1 or 0)
  if within then metric('time_s', within) end
end)

-- As a learning environment: docs/python.md.
episode { seconds = 30 }
reward(function() return -error_u() end)
success(function(t) return within and t > within + 1 end)
info { ball = 0, error_u = error_u }
