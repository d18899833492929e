-- A box on three pins of different heights: its load, how the pins share it, and whether it rests. The shares are those of
-- the lever law at the pose in which the box lies: a tilted face bears on the corner of each top that is highest under it.
local truth = require 'truth'
local heights = { { 4, 4, 1.3 }, { 8, 4, 1.32 }, { 6, 8, 1.35 } }  -- x, y, height of the top
truth.world { iterations = option('iterations', 10) }
material { name = 'default', friction = 0.5 }
surface { rows = 12, columns = 12, sensors = { pressure {} },
          actuator = pin { range = { 0, 3 }, max_speed = 20, max_acceleration = 1000 } }
at(0, function()
  local all = {}
  for i = 1, 144 do all[i] = 1 end
  cells:targets('height', all)
  for _, p in ipairs(heights) do cells:target('height', 12 - p[2], p[1] + 1, p[3]) end
end)
local id
at(1, function() id = box { size = { 5, 5, 1 }, mass = 25, position = { 6, 6, 1.85 } } end)
local loads, ticks, from = { 0, 0, 0 }, 0, nil
truth.sample(function(t)
  if t < 7 then return end
  ticks, from = ticks + 1, from or truth.position(id)
  for i, p in ipairs(heights) do loads[i] = loads[i] + cells:truth('pressure', 12 - p[2], p[1] + 1) end
end)
on_finish(function()
  local up, middle = truth.rotate(id, { 0, 0, 1 }), truth.position(id)
  local rows = {}
  for i, p in ipairs(heights) do
    -- The corner under which the face is lowest: against the horizontal part of its normal, which points downhill.
    rows[i] = { p[1] + (up[1] > 0 and 0.4 or -0.4) - middle[1], p[2] + (up[2] > 0 and 0.4 or -0.4) - middle[2] }
  end
  -- Shares s with sum 1 and no moment about the middle, by Cramer's rule: barycentric coordinates of the middle.
  local function area(a, b) return a[1] * b[2] - a[2] * b[1] end
  local whole = area(rows[1], rows[2]) + area(rows[2], rows[3]) + area(rows[3], rows[1])
  local weight, worst, sum = 25 * truth.g, 0, 0
  for i = 1, 3 do
    local share = area(rows[i % 3 + 1], rows[(i + 1) % 3 + 1]) / whole
    sum, worst = sum + loads[i] / ticks, math.max(worst, math.abs(loads[i] / ticks - share * weight))
  end
  metric('load', sum)
  metric('worst', worst / weight)
  metric('creep', truth.norm(truth.sub(truth.position(id), from)))
end)
