-- An object anywhere on 16×16 tactile pillars is to lie at a goal. The goal is the pillar below a lamp, which hangs higher
-- than any object and which only the sensor 'goal' sees.
local arraybot = require 'arraybot'
arraybot.surface { sensors = { proximity { name = 'goal', origin = { 0, 0, 40 }, range = 20 } } }

local x, y = arraybot.place(3)
local goal_x, goal_y
repeat
  goal_x, goal_y = math.random(3, 12) * arraybot.pitch, math.random(3, 12) * arraybot.pitch
until (goal_x - x) ^ 2 + (goal_y - y) ^ 2 > (3 * arraybot.pitch) ^ 2
local thing = arraybot.object(x, y, { random(4, 6.5), random(4, 6.5), random(3.5, 6) })
sphere { radius = 0.8, position = { goal_x, goal_y, 55 }, fixed = true, colour = 'yellow', label = 'lamp' }

local function distance()
  local px, py = object(thing):position()
  return math.min(math.sqrt((px - goal_x) ^ 2 + (py - goal_y) ^ 2), 30)
end
local sum, ticks, last = 0, 0, arraybot.last_second()
on_tick(function()
  sum, ticks = sum + distance(), ticks + 1
  last.add(distance())
end)
on_finish(function()
  local error = last.greatest()
  metric('error_cm', error)
  metric('success', error < 2 and object(thing):on_table() and 1 or 0)
  metric('score', -sum / ticks - error)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 20 }
reward(function() return -distance() end)
info { object = thing, distance_cm = distance }
