-- A ball follows a point that goes along a line, a circle and an 8, twenty seconds each.
local leg = 20

material { name = 'felt', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 24, columns = 24, material = 'felt',
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 } } }
sphere { radius = 1.5, colour = 'cyan', material = 'felt',
         position = { 11.5 + random(-2, 2), 11.5 + random(-2, 2), 3 } }

local function point(t)
  local a = 2 * math.pi * (t / leg % 1)
  if t < leg then return 6 * math.sin(a), 0, 'line' end
  if t < 2 * leg then return 4 * math.sin(a), 4 - 4 * math.cos(a), 'circle' end
  return 6 * math.sin(a), 3 * math.sin(2 * a), 'eight'
end

local sum, count = { line = 0, circle = 0, eight = 0 }, { line = 0, circle = 0, eight = 0 }
on_tick(function(t)
  if t % leg < 2 or t >= 3 * leg then return end    -- the ball still comes to the path
  local px, py, path = point(t)
  local x, y = object(0):position()
  sum[path] = sum[path] + (x - 11.5 - px)^2 + (y - 11.5 - py)^2
  count[path] = count[path] + 1
end)
on_finish(function()
  local worst = 0
  for path, n in pairs(count) do
    local rms = n > 0 and math.sqrt(sum[path] / n) or math.huge
    if n > 0 then metric('rms_' .. path .. '_u', rms) end
    worst = math.max(worst, rms)
  end
  metric('success', worst < 0.5 and object(0):on_table() and 1 or 0)
end)

-- As a learning environment: docs/python.md.
local function error_u(t)
  local px, py = point(t)
  local x, y = object(0):position()
  return math.sqrt((x - 11.5 - px)^2 + (y - 11.5 - py)^2)
end
episode { seconds = 3 * leg }
reward(function(t) return -error_u(t) end)
info { ball = 0, error_u = error_u, target_x = function(t) return 11.5 + point(t) end,
       target_y = function(t) return 11.5 + select(2, point(t)) end }
