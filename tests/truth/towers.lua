-- Nine towers of twelve boxes that fall onto each other one by one: how many fall over. The
-- middle of each box is over the box below, and so is that of all boxes above it.
local truth = require 'truth'
truth.world { seed = option('towers', 1) }
material { name = 'default', friction = 0.5, restitution = 0 }
surface { rows = 48, columns = 48, actuator = pin { top = 1 } }
local towers, gap = {}, option('gap', 3.0)
for k = 0, 8 do
  local top, ids, side = 0, {}, random(1.5, 3)
  local size = { side, side, side }
  for i = 1, 12 do
    ids[i] = box { size = size, position = { 8 + 16 * (k % 3) + random(-0.1, 0.1), 8 + 16 * (k // 3) + random(-0.1, 0.1),
                                             top + gap * i + size[3] / 2 } }
    top = top + size[3]
    towers[k + 1] = { last = ids[i], height = top - size[3] / 2 }
  end
end
on_finish(function()
  local fallen = 0
  for _, tower in ipairs(towers) do
    if truth.position(tower.last)[3] < tower.height - 0.5 then fallen = fallen + 1 end
  end
  metric('fallen', fallen)
end)
