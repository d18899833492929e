-- Two discs of opposite polarity and one that is not magnetic on an 8×8 workbench of electromagnets, 2 u apart.
surface { rows = 8, columns = 8, pitch = 2,
          actuator = magnet { top = 1.6, strength = 150, depth = 1, law = 'pole' },
          sensors = { proximity { range = 4 }, colour { range = 4 } } }
local function disc(label, pole, x, y)
  return cylinder { radius = 0.9, height = 0.6, pole = pole, label = label,
                    colour = ({ [1] = 'red', [0] = 'grey', [-1] = 'blue' })[pole],
                    position = { x + random(-0.4, 0.4), y + random(-0.4, 0.4), 0.3 } }
end
local goal_x, goal_y = 8, 6
local pulled, pushed, plain = disc('pulled', 1, 2, 6), disc('pushed', -1, 10, 6), disc('plain', 0, 2, 12)

local function far(id, x0, y0)
  local x, y = object(id):position()
  return math.sqrt((x - x0)^2 + (y - y0)^2)
end
local pushed_from, plain_x, plain_y
at(0, function()
  pushed_from = far(pushed, goal_x, goal_y)
  plain_x, plain_y = object(plain):position()
end)
on_finish(function()
  local pulled_error, pushed_by = far(pulled, goal_x, goal_y), far(pushed, goal_x, goal_y) - pushed_from
  local moved = far(plain, plain_x, plain_y)
  local on_table = object(pulled):on_table() and object(pushed):on_table() and object(plain):on_table()
  metric('success', on_table and pulled_error < 0.5 and pushed_by > 4 and moved < 0.1 and 1 or 0)
  metric('on_table', on_table and 1 or 0)
  metric('pulled_error_u', pulled_error)
  metric('pushed_away_u', pushed_by)
  metric('plain_moved_u', moved)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 6 }
reward(function()
  return math.min(far(pushed, goal_x, goal_y) - (pushed_from or 0), 4) - far(pulled, goal_x, goal_y)
end)
info { pulled = pulled, pushed = pushed, plain = plain }
