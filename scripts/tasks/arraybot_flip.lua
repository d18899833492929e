-- An object that stands on 16×16 pillars that feel is to be turned over: its own vertical nearer to the level than upright, or
-- upside down, and to lie still.
local arraybot = require 'arraybot'
arraybot.surface {}

local x, y = arraybot.place(4)
local thing = arraybot.object(x, y, { random(3.5, 4.5), random(3.5, 4.5), random(5.5, 6.5) })

local sum, ticks, angles = 0, 0, arraybot.last_second()
local function speed()
  local vx, vy, vz = object(thing):velocity()
  return math.sqrt(vx ^ 2 + vy ^ 2 + vz ^ 2)
end
local function on_table()
  local px, py, z = object(thing):position()
  return z > 0 and math.abs(px - arraybot.middle) < 8 * arraybot.pitch and math.abs(py - arraybot.middle) < 8 * arraybot.pitch
end
on_tick(function()
  sum, ticks = sum + (on_table() and math.min(arraybot.turned(thing), 60) / 60 or 0), ticks + 1
  angles.add(on_table() and arraybot.turned(thing) or 0)
end)
on_finish(function()
  local angle = angles.least()
  metric('turned_deg', angle)
  metric('speed_cm_s', speed())
  metric('success', angle > 45 and speed() < 1 and 1 or 0)
  metric('score', sum / ticks + math.min(angle, 60) / 60 - math.min(speed(), 5) / 10)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 10 }
reward(function() return on_table() and math.min(arraybot.turned(thing), 60) / 60 or 0 end)
info { object = thing, turned_deg = function() return arraybot.turned(thing) end }
