-- A slender box leans on its edge and falls over; its spin as it passes `angle` (degrees from upright).
local truth = require 'truth'
local h, d, start, angle = option('h', 4.0), option('d', 0.5), option('start', 15.0), option('angle', 60.0)
truth.world {}
material { name = 'default', friction = 1.0, restitution = 0 }
surface { rows = 8, columns = 16, actuator = pin { top = 1 } }
local lean = math.rad(start)
local id = box { size = { d, 3, h },
                 position = { 5.5 + math.sin(lean) * h / 2 - math.cos(lean) * d / 2, 3.5,
                              math.cos(lean) * h / 2 + math.sin(lean) * d / 2 },
                 orientation = { axis = { 0, 1, 0 }, angle = lean } }
local spin, before
truth.sample(function()
  local up = truth.rotate(id, { 0, 0, 1 })
  local now, w = math.deg(math.atan(up[1], up[3])), truth.spin(id)[2]
  if before and not spin and before[1] < angle and now >= angle then
    spin = before[2] + (w - before[2]) * (angle - before[1]) / (now - before[1])
  end
  before = { now, w }
end)
on_finish(function() metric('spin', spin or 0) end)
