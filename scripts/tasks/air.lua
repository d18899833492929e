-- A light sheet floats over 40×40 jets of air to a goal, without ever touching the table.
local goal_x, goal_y = 30, 22
surface { rows = 40, columns = 40, actuator = air_jet { lean = 0.35, max_flow = 60 } }
local sheet = box { size = {6, 6, 0.2}, mass = 1.7, colour = 'yellow',
                    position = { random(6, 20), random(6, 33), 0.8 } }

local function error_u()
  local x, y = object(sheet):position()
  return math.sqrt((x - goal_x)^2 + (y - goal_y)^2)
end
local lowest, within = math.huge, nil
on_tick(function(t)
  local _, _, z = object(sheet):position()
  if t > 1 then lowest = math.min(lowest, z - 0.1) end
  within = error_u() < 1 and (within or t) or nil
end)
on_finish(function()
  metric('success', within and lowest > 0 and 1 or 0)
  metric('error_u', error_u())
  if within then metric('time_s', within) end
  metric('least_gap_u', lowest)
end)
