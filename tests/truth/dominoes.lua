-- A row of dominoes; nearly frictionless against one another, firm on the cells. The speed of the wave, well after its start.
local truth = require 'truth'
local h, d, gap = option('h', 4.0), option('d', 0.5), option('gap', 1.5)
truth.world { sleep = false }
material { name = 'firm', friction = 100, restitution = 0 }
material { name = 'slick', friction = 0.01, restitution = 0 }
local n, first, last = 34, 22, 32
surface { rows = 6, columns = 76, material = 'firm', actuator = pin { top = 1 } }
local ids = {}
for i = 1, n do
  -- The first leans by 0.3 rad over its edge.
  local lean = i == 1 and 0.3 or 0
  ids[i] = box { size = { d, 3, h }, material = 'slick', orientation = { axis = { 0, 1, 0 }, angle = lean },
                 position = { 2 + (d + gap) * i + math.sin(lean) * h / 2 - math.cos(lean) * d / 2, 2.5,
                              math.cos(lean) * h / 2 + math.sin(lean) * d / 2 } }
end
local passed, before = {}, {}
truth.sample(function(t)
  for i = first, last, last - first do
    local up = truth.rotate(ids[i], { 0, 0, 1 })
    local now = math.atan(up[1], up[3])
    if before[i] and not passed[i] and now >= 0.1 then
      passed[i] = t - truth.dt * (now - 0.1) / (now - before[i])
    end
    before[i] = now
  end
end)
on_finish(function()
  metric('speed', passed[last] and (last - first) * (d + gap) / (passed[last] - passed[first]) or 0)
end)
