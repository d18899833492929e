-- An object on 16×16 tactile pillars is to be turned over: by more than 60° from how it lay after a second, and to lie still.
local arraybot = require 'arraybot'
arraybot.surface {}

local x, y = arraybot.place(4)
local thing = arraybot.object(x, y, { random(4, 5.5), random(4, 5.5), random(4, 5.5) })

local before  -- how it lay
at(1, function() before = arraybot.upright(thing) end)
-- By how much it is turned, in degrees; 0 where it fell off.
local function turned()
  return before and object(thing):on_table() and arraybot.turned(thing, before) or 0
end
local function speed()
  local vx, vy, vz = object(thing):velocity()
  return math.sqrt(vx ^ 2 + vy ^ 2 + vz ^ 2)
end
local sum, ticks, angles = 0, 0, arraybot.last_second()
on_tick(function()
  sum, ticks = sum + math.min(turned(), 90) / 90, ticks + 1
  angles.add(turned())
end)
on_finish(function()
  local angle = angles.least()
  metric('turned_deg', angle)
  metric('speed_cm_s', speed())
  metric('success', angle > 60 and speed() < 1 and 1 or 0)
  metric('score', sum / ticks + math.min(angle, 75) / 75 - math.min(speed(), 5) / 10)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 10 }
reward(function() return math.min(turned(), 90) / 90 end)
info { object = thing, turned_deg = turned }
