-- A light sheet floats over 40×40 jets of air to a goal, without ever touching the table.
local goal_x, goal_y = 26, 20
surface { rows = 40, columns = 40, actuator = air_jet { lean = 0.35, max_flow = 60 },
          sensors = { proximity { range = 8 } } }
local sheet = box { size = {6, 6, 0.2}, mass = 1.2, colour = 'yellow',
                    position = { random(6, 20), random(6, 33), 2 } }

local function error_u()
  local x, y = object(sheet):position()
  return math.sqrt((x - goal_x)^2 + (y - goal_y)^2)
end
-- The gap under the sheet's lowest corner: half its edges, seen along the vertical.
local function gap_u()
  local _, _, z = object(sheet):position()
  local qx, qy, qz, qw = object(sheet):orientation()
  local pitch, roll = 2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx)
  return z - 3 * math.abs(pitch) - 3 * math.abs(roll) - 0.1
end
local lowest, within = math.huge, nil
on_tick(function(t)
  if t > 1 then lowest = math.min(lowest, gap_u()) end
  within = error_u() < 1 and object(sheet):on_table() and (within or t) or nil
end)
on_finish(function()
  metric('success', within and lowest > 0 and 1 or 0)
  metric('error_u', error_u())
  if within then metric('time_s', within) end
  if lowest < math.huge then metric('least_gap_u', lowest) end
end)

-- As a learning environment: docs/python.md.
episode { seconds = 40 }
reward(function() return -error_u() - (gap_u() < 0 and 10 or 0) end)
success(function(t) return within and t > within + 1 and lowest > 0 end)
info { sheet = sheet, error_u = error_u, gap_u = gap_u }
