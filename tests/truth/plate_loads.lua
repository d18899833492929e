-- A box of n × n cells at rest: the load of each cell beside the law of equal small compliances, which is linear in the
-- cell's position. `slope` tilts gravity; `rider` is the mass of a small box at (`rider_x`, 0) on top.
local truth = require 'truth'
local n, slope, rider, rider_x = option('n', 5), option('slope', 0.0), option('rider', 0.0), option('rider_x', 1.0)
truth.world { gravity = truth.slope(slope), sleep = option('sleep', false) }
material { name = 'default', friction = 0.8 }
local rows = n + 4
surface { rows = rows, columns = rows, actuator = pin {}, sensors = { pressure {} } }
local mass, height, middle = n * n, 1, (rows - 1) / 2
local id = box { size = { n, n, height }, mass = mass, position = { middle, middle, height / 2 } }
local top
if rider > 0 then
  top = box { size = { 1, 1, 1 }, mass = rider, position = { middle + rider_x, middle, height + 0.5 } }
end
local sums, ticks = {}, 0
truth.sample(function(t)
  if t < 1 then return end
  ticks = ticks + 1
  for i = 1, rows * rows do
    sums[i] = (sums[i] or 0) + cells:truth('pressure', (i - 1) // rows + 1, (i - 1) % rows + 1)
  end
end)
on_finish(function()
  local gx, gz = truth.g * math.sin(math.rad(slope)), truth.g * math.cos(math.rad(slope))
  -- Moment of all forces about the middle of the base, in the direction that loads the east.
  local moment = mass * gx * height / 2 + rider * (gx * (height + 0.5) + gz * rider_x)
  local squares = 0
  for c = 1, n do squares = squares + n * (c - (n + 1) / 2) ^ 2 end
  local total, worst, loaded, turn = 0, 0, 0, 0
  for r = 1, rows do
    for c = 1, rows do
      local load, x = sums[(r - 1) * rows + c] / ticks, c - 1 - middle
      total, turn = total + load, turn + load * x
      if load > 0 then loaded = loaded + 1 end
      local inside = r > 2 and r <= n + 2 and c > 2 and c <= n + 2
      local right = inside and (mass + rider) * gz / (n * n) + moment * x / squares or 0
      worst = math.max(worst, math.abs(load - right))
    end
  end
  metric('load', total)
  metric('moment', turn)
  metric('worst', worst * n * n / ((mass + rider) * gz))
  metric('cells', loaded)
end)
