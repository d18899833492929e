-- What intralogistics publishes of a run, by the definitions of MagBotSim (Bergmann and others, arXiv 2511.16158): throughput,
-- makespan, overshoot and distance corrections, collisions, and smoothness, the mean over the ticks of the sum over all
-- objects and both axes of 15·|jerk| + 5·|acceleration| + |velocity|.
local logistics = {}

-- The gap between two rectangles { x, y, heading, length, width }, seen along their sides; below 0 where they overlap.
function logistics.gap(a, b)
  local gap = -math.huge
  for _, heading in ipairs { a.heading, a.heading + math.pi / 2, b.heading, b.heading + math.pi / 2 } do
    local function reach(o)
      return (o.length * math.abs(math.cos(o.heading - heading)) + o.width * math.abs(math.sin(o.heading - heading))) / 2
    end
    gap = math.max(gap, math.abs((a.x - b.x) * math.cos(heading) + (a.y - b.y) * math.sin(heading)) - reach(a) - reach(b))
  end
  return gap
end

-- `threshold`: how near a goal is reached. `unit`: of lengths in m, for the smoothness, which is in m and s.
function logistics.new(threshold, unit)
  local all, dt = {}, nil
  local sums = { goals = 0, overshoots = 0, distances = 0, collisions = 0, smoothness = 0, ticks = 0, last = 0 }
  local touching = {}
  local meter = { sums = sums }

  -- Gives an object a goal, until `reached`.
  function meter.aim(id, x, y)
    local one = all[id] or {}
    all[id] = one
    one.x, one.y, one.within, one.before, one.grew, one.overshoots, one.distances = x, y, false, math.huge, false, 0, 0
  end

  function meter.reached(id, t)
    local one = all[id]
    sums.goals, sums.last = sums.goals + 1, t
    sums.overshoots, sums.distances = sums.overshoots + one.overshoots, sums.distances + one.distances
  end

  function meter.distance(id)
    local x, y = object(id):position()
    return math.sqrt((x - all[id].x) ^ 2 + (y - all[id].y) ^ 2)
  end

  -- A pair collides when its gap, in u, falls below 1 mm, and again only after 1 cm.
  function meter.pair(a, b, gap)
    local key = a < b and a .. '-' .. b or b .. '-' .. a
    if gap < 0.001 / unit and not touching[key] then touching[key], sums.collisions = true, sums.collisions + 1 end
    if gap > 0.01 / unit then touching[key] = nil end
  end

  -- Call it every tick, in the order of the ids.
  function meter.update(t)
    dt, sums.ticks = sums.t and t - sums.t, sums.ticks + 1
    sums.t = t
    for id, one in pairs(all) do
      local d = meter.distance(id)
      local within = d < threshold
      if one.within and not within then one.overshoots = one.overshoots + 1 end
      one.within = within
      local still = 2e-5 / unit
      if d > one.before + still then
        one.grew = true
      elseif one.grew and d < one.before - still then
        one.grew, one.distances = false, one.distances + 1
      end
      one.before = d
      local vx, vy = object(id):velocity()
      if dt and one.vx then
        local ax, ay = (vx - one.vx) / dt, (vy - one.vy) / dt
        local jerk = one.ax and (math.abs(ax - one.ax) + math.abs(ay - one.ay)) / dt or 0
        sums.smoothness = sums.smoothness + unit * (15 * jerk + 5 * (math.abs(ax) + math.abs(ay)) + math.abs(vx) + math.abs(vy))
        one.ax, one.ay = ax, ay
      end
      one.vx, one.vy = vx, vy
    end
  end

  function meter.forget(id) all[id] = nil end

  function meter.report()
    metric('goals', sums.goals)
    metric('collisions', sums.collisions)
    metric('smoothness', sums.smoothness / math.max(1, sums.ticks))
    if sums.goals > 0 then
      metric('makespan_s', sums.last)
      metric('goals_per_minute', 60 * sums.goals / sums.last)
      metric('overshoot_corrections', sums.overshoots / sums.goals)
      metric('distance_corrections', sums.distances / sums.goals)
    end
  end
  return meter
end

return logistics
