-- Rain: so many small balls fall on the table within ten seconds, and the table sheds them.
local count = option('count', 2000, 'balls', { 1, 100000 })
local n, seconds = option('n', 64, 'rows and columns'), 10

world { off_table = 'remove' }
surface { rows = n, columns = n, actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 } } }

local fallen, left, shed_at = 0, 0, nil
on_tick(function(t)
  while fallen < count and fallen < count * t / seconds do
    fallen = fallen + 1
    sphere { radius = random(0.6, 1), colour = 'cyan',
             position = { random(1, n - 2), random(1, n - 2), random(8, 12) } }
  end
end)
on_leave(function(id, t)
  left = left + 1
  if left >= 0.95 * count then shed_at = shed_at or t end
end)
on_finish(function()
  metric('success', shed_at and 1 or 0)
  metric('shed', left / count)
  if shed_at then metric('time_to_95_s', shed_at) end
end)

-- As a learning environment: docs/python.md.
local scored = 0
episode { seconds = 40 }
reward(function()
  local before = scored
  scored = left / count
  return scored - before
end)
success(function() return shed_at ~= nil end)
info { fallen = function() return fallen end, left = function() return left end }
