-- A cylinder upright on level cells: each bears in proportion to the part of its top that the circle covers.
local truth = require 'truth'
local mass, radius = option('mass', 21.0), 2.2
truth.world { sleep = option('sleep', false) }
surface { rows = 9, columns = 9, actuator = pin {}, sensors = { pressure {} } }
local id = cylinder { radius = radius, height = 1, mass = mass, position = { 4, 4, 0.5 } }
local sums, ticks = {}, 0
truth.sample(function(t)
  if t < 1 then return end
  ticks = ticks + 1
  for i = 1, 81 do sums[i] = (sums[i] or 0) + cells:truth('pressure', (i - 1) // 9 + 1, (i - 1) % 9 + 1) end
end)

-- The part of the top of the cell at (x, y) from the middle that lies in the circle.
local function share(x, y)
  local n, inside = 100, 0
  for i = 0, n * n - 1 do
    local u, v = x + 0.8 * ((i % n + 0.5) / n - 0.5), y + 0.8 * ((i // n + 0.5) / n - 0.5)
    if u * u + v * v <= radius * radius then inside = inside + 1 end
  end
  return inside / (n * n)
end
on_finish(function()
  local total, worst, shares, all = 0, 0, {}, 0
  for i = 1, 81 do
    shares[i] = share((i - 1) % 9 - 4, (i - 1) // 9 - 4)
    all = all + shares[i]
  end
  for i = 1, 81 do
    local load = sums[i] / ticks
    total = total + load
    worst = math.max(worst, math.abs(load - mass * truth.g * shares[i] / all))
  end
  metric('load', total)
  metric('worst', worst * all / (mass * truth.g))
end)
