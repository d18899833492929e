-- What the tasks push_t and push_t_pins share: the T, its goal, and the share of the goal that it covers.

-- Declares the T anywhere on a table of side × side cells and however it is turned, metrics and learning environment. goal: its
-- x, y and yaw; seconds: the length of an episode; material: the T's.
return function(task)
  local side, goal, wanted = task.side, task.goal, 0.95
  local tee = mesh { file = 'tee.obj', position = { random(10, side - 11), random(10, side - 11), 0.8 },
                     orientation = { yaw = random(-math.pi, math.pi) }, material = task.material, colour = 'grey', label = 'tee' }

  -- The T in its own axes. Their origin is its centre of mass, which divides the 6 u between the middles of the bar (36 u²)
  -- and the stem (27 u²).
  local bar_low = 6 * 27 / 63 - 1.5
  local function inside(x, y)
    y = y - bar_low
    return y <= 3 and math.abs(x) <= 6 and (y >= 0 or (y >= -9 and math.abs(x) <= 1.5))
  end
  local points = {}
  for x = -5.9, 6, 0.2 do
    for y = -8.9 + bar_low, 3 + bar_low, 0.2 do
      if inside(x, y) then points[#points + 1] = { x, y } end
    end
  end

  -- What the T is off its goal: east and north in u, counter-clockwise in rad.
  local function pose()
    local x, y = object(tee):position()
    local qx, qy, qz, qw = object(tee):orientation()
    local turn = math.atan(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)) - goal.yaw
    return x - goal.x, y - goal.y, (turn + math.pi) % (2 * math.pi) - math.pi
  end
  -- The share of the goal that the T covers.
  local function coverage()
    if not object(tee):on_table() then return 0 end
    local dx, dy, turn = pose()
    local c, s, covered = math.cos(turn), math.sin(turn), 0
    -- The shift in the goal's axes; then every point of the goal in the axes of the T.
    local gx = dx * math.cos(goal.yaw) + dy * math.sin(goal.yaw)
    local gy = dy * math.cos(goal.yaw) - dx * math.sin(goal.yaw)
    for _, p in ipairs(points) do
      local x, y = p[1] - gx, p[2] - gy
      if inside(x * c + y * s, y * c - x * s) then covered = covered + 1 end
    end
    return covered / #points
  end

  local reached
  every(0.1, function(t)
    if not reached and coverage() >= wanted then reached = t end
  end)
  on_finish(function()
    local dx, dy, turn = pose()
    local covered = coverage()
    metric('success', covered >= wanted and 1 or 0)
    metric('coverage', covered)
    if reached then metric('time_s', reached) end
    metric('error_u', math.sqrt(dx^2 + dy^2))
    metric('angle_error_deg', math.abs(math.deg(turn)))
  end)

  -- As a learning environment: docs/python.md.
  local before = 0
  episode { seconds = task.seconds }
  reward(function()
    local now = coverage()
    local gained = now - before
    before = now
    return gained
  end)
  on_reset(function() before = coverage() end)
  success(function() return coverage() >= wanted end)
  info { coverage = coverage }
end
