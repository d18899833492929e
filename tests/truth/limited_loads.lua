-- A box on 5 × 5 raised pins of limited force, and a force `lever` east of its middle: the load of each cell beside the
-- least squares within the limits, min(limit, max(0, a + b·x)).
local truth = require 'truth'
local limit, force, lever = option('limit', 40.0), option('force', 400.0), option('lever', 1.0)
truth.world { sleep = false }
material { name = 'default', friction = 0.5 }
surface { rows = 9, columns = 9, sensors = { pressure {} },
          actuator = pin { range = { 0, 2 }, max_speed = 2, max_acceleration = 5, max_force = limit } }
local mass, middle = 25, 4
local id = box { size = { 5, 5, 1 }, mass = mass, position = { middle, middle, 0.5 } }
at(0, function()
  local all = {}
  for k = 1, 81 do all[k] = 1 end
  cells:targets('height', all)
end)
local sums, ticks = {}, 0
truth.sample(function(t)
  local share = math.max(0, math.min(1, t - 2))  -- the force grows within a second
  if share > 0 then object(id):push { force = { 0, 0, -share * force }, point = { middle + lever, middle, 1.5 } } end
  if t < 3.5 then return end
  ticks = ticks + 1
  for i = 1, 81 do sums[i] = (sums[i] or 0) + cells:truth('pressure', (i - 1) // 9 + 1, (i - 1) % 9 + 1) end
end)
on_finish(function()
  local function load_at(a, b, x) return math.min(limit, math.max(0, a + b * x)) end
  local function bisect(low, high, is_below)
    for _ = 1, 80 do
      local mid = (low + high) / 2
      if is_below(mid) then low = mid else high = mid end
    end
    return low
  end
  local total, moment, a = mass * truth.g + force, force * lever, 0
  local b = bisect(0, 2 * limit, function(b)
    a = bisect(-10 * limit, 10 * limit, function(level)
      local sum = 0
      for x = -2, 2 do sum = sum + 5 * load_at(level, b, x) end
      return sum < total
    end)
    local sum = 0
    for x = -2, 2 do sum = sum + 5 * x * load_at(a, b, x) end
    return sum < moment
  end)
  local sum, worst, full = 0, 0, 0
  for r = 1, 9 do
    for c = 1, 9 do
      local load, x = sums[(r - 1) * 9 + c] / ticks, c - 1 - middle
      local inside = math.abs(x) <= 2 and math.abs(r - 5) <= 2
      sum, worst = sum + load, math.max(worst, math.abs(load - (inside and load_at(a, b, x) or 0)))
      if load > 0.99 * limit then full = full + 1 end
    end
  end
  metric('load', sum)
  metric('worst', worst / limit)
  metric('full', full)
end)
