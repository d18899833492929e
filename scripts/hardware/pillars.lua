-- An array of 16×16 pillars as ArrayBot's: 16 mm wide with 1 mm gaps, 55 mm of travel, touch alone, 100 control periods a second.
-- A ball is to roll to the middle. pillars.aps was learned here by scripts/hardware/learn; it drives the emulated device as well.
world { unit = 'cm', control_period = 0.01, dt = 0.0025, seed = option('seed', 1, 'of the place of the ball') }
material { name = 'foam', friction = 0.6, rolling_friction = 0.1, restitution = 0 }
surface { rows = 16, columns = 16, pitch = 1.7, material = 'foam', sensors = { pressure {} },
          actuator = pin { top = 1.6, range = { 0, 5.5 }, max_speed = 20, max_acceleration = 400 } }

local middle = 7.5 * 1.7
local ball = sphere { radius = 4, mass = 0.01, position = { random(6, 19.5), random(6, 19.5), 5 }, material = 'foam', colour = 'orange' }

local function distance()
  local x, y = object(ball):position()
  return math.min(math.sqrt((x - middle) ^ 2 + (y - middle) ^ 2), 20)  -- also where it fell off
end
local sum, ticks, last = 0, 0, {}
on_tick(function()
  sum, ticks = sum + distance(), ticks + 1
  last[ticks % 100 + 1] = distance()
end)
episode { seconds = 6 }
reward(function() return -distance() end)
on_finish(function()
  local error = 0
  for _, d in ipairs(last) do error = error + d / #last end
  metric('error_cm', error)
  metric('success', error < 1 and 1 or 0)
  metric('score', -sum / ticks - error)
end)
