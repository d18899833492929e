-- A ball on 8×8 pins is to roll below a blue lamp that hangs anywhere above them. The pins see the colours above them.
local radius, lamp_x, lamp_y = 1.2, random(2, 5), random(2, 5)
local near = 0.75  -- u

material { name = 'felt', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 8, columns = 8, material = 'felt', border = { height = 5 },
          actuator = pin { range = {0, 5}, max_speed = 6, max_acceleration = 60 }, sensors = { colour { range = 20 } } }
local ball = sphere { radius = radius, position = { random(2, 5), random(2, 5), 4 }, colour = '#ff0000', material = 'felt' }
sphere { radius = 0.7, position = { lamp_x, lamp_y, 12 }, colour = '#0000ff', fixed = true }

-- The error is the mean distance of the last second, the score minus that of the whole run.
local function distance()
  local x, y = object(ball):position()
  return math.sqrt((x - lamp_x)^2 + (y - lamp_y)^2)
end
local sum, last, ticks = 0, {}, 0
on_tick(function()
  sum, ticks = sum + distance(), ticks + 1
  last[ticks % 60 + 1] = distance()
end)
episode { seconds = 10 }
reward(function() return -distance() end)
on_finish(function()
  local error = 0
  for _, d in ipairs(last) do error = error + d / #last end
  metric('error_u', error)
  metric('success', error < near and 1 or 0)
  metric('score', -sum / ticks)
end)
