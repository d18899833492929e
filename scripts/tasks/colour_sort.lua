-- Balls of one size and two colours: blue ones belong in the western half, red ones in the eastern.
local count = option('count', 8, 'balls of each colour')
local n, radius = option('n', 40, 'rows and columns'), 2

material { name = 'plastic', friction = 0.25 }
surface { rows = n, columns = n, material = 'plastic', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 }, colour { range = 8 } } }

-- One ball in each of as many squares of a grid: none begins in another.
local side = math.ceil(math.sqrt(2 * count))
local free = {}
for i = 0, side * side - 1 do free[#free + 1] = i end
for i = 1, 2 * count do
  local place = table.remove(free, math.floor(random(1, #free + 1)))
  local square = (n - 3) / side
  local x, y = 1 + square * (place % side), 1 + square * (place // side)
  local red = i <= count
  sphere { radius = radius, material = 'plastic', colour = red and 'red' or 'blue', label = red and 'red' or 'blue',
           position = { random(x + radius, x + square - radius), random(y + radius, y + square - radius), 7 } }
end

local middle, sorted_at, purity = (n - 1) / 2, nil, 0
on_tick(function(t)
  local right = 0
  for _, ball in ipairs(objects()) do
    local x, _, z = ball:position()
    if z > 0 and (x > middle) == (ball:label() == 'red') then right = right + 1 end
  end
  purity = right / (2 * count)
  sorted_at = purity >= 0.95 and (sorted_at or t) or nil
  if sorted_at and t > sorted_at + 5 then stop() end
end)
on_finish(function()
  metric('purity', purity)
  if sorted_at then
    metric('time_to_95_s', sorted_at)
    metric('objects_per_minute', 60 * 2 * count / sorted_at)
  end
end)
