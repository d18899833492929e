-- An object anywhere on 16×16 tactile pillars is to be lifted by 3 cm and held still.
local arraybot = require 'arraybot'
arraybot.surface {}

local x, y = arraybot.place(4)
local height = random(3.5, 6)
local thing = arraybot.object(x, y, { random(4, 6.5), random(4, 6.5), height })

-- How much higher the centre is than that of an object that stands on lowered pillars.
local function lifted()
  local _, _, z = object(thing):position()
  return z - height / 2
end
local sum, ticks, heights, xs, ys = 0, 0, arraybot.last_second(), arraybot.last_second(), arraybot.last_second()
on_tick(function()
  local px, py = object(thing):position()
  sum, ticks = sum + math.min(lifted(), 3), ticks + 1
  heights.add(lifted())
  xs.add(px)
  ys.add(py)
end)
on_finish(function()
  local up = heights.least()
  local moved = math.max(xs.greatest() - xs.least(), ys.greatest() - ys.least())
  metric('lifted_cm', up)
  metric('moved_cm', moved)
  metric('success', up > 3 and moved < 1 and object(thing):on_table() and 1 or 0)
  metric('score', sum / ticks + math.min(up, 3.5) - math.min(moved, 3))
end)

-- As a learning environment: docs/python.md.
episode { seconds = 8 }
reward(function() return math.min(lifted(), 3) end)
info { object = thing, lifted_cm = lifted }
