-- What the sorting tasks share: two kinds of objects, one that belongs in the western half and one in the eastern.
local two_kinds = {}

-- Calls make(kind, x, y) for `count` objects of each kind, each in a square of a grid of its own.
function two_kinds.scatter(n, count, reach, make)
  local side = math.ceil(math.sqrt(2 * count))
  local square, free = (n - 3) / side, {}
  if square < 2 * reach then error('too many objects: each needs a square of ' .. 2 * reach .. ' u') end
  for i = 0, side * side - 1 do free[#free + 1] = i end
  for i = 1, 2 * count do
    local place = table.remove(free, math.floor(random(1, #free + 1)))
    local x, y = 1 + square * (place % side), 1 + square * (place // side)
    make(i <= count and 'east' or 'west', random(x + reach, x + square - reach), random(y + reach, y + square - reach))
  end
end

-- Purity: the share of the objects in their own half of the table, by their labels 'east' and 'west'. Sorted: at least 0.95, for
-- five seconds on end; then the run ends.
function two_kinds.measure(n, count)
  local now, purity, sorted_at = 0, 0, nil
  metric('purity', function()
    local right = 0
    for _, part in ipairs(objects()) do
      if part:on_table() and (part:position() > (n - 1) / 2) == (part:label() == 'east') then right = right + 1 end
    end
    now = right / (2 * count)
    return now
  end)
  local function held(t) return sorted_at and t > sorted_at + 5 and sorted_at end
  on_tick(function(t)
    purity = now
    sorted_at = purity >= 0.95 and (sorted_at or t) or nil
    if held(t) then stop(string.format('sorted after %.1f s', sorted_at), true) end
  end)
  reward(function() return purity end)
  success(held)
  info { purity = function() return purity end }
  on_finish(function()
    metric('success', held(time()) and 1 or 0)
    if held(time()) then
      metric('time_to_95_s', sorted_at)
      metric('objects_per_minute', 60 * 2 * count / math.max(sorted_at, 1 / 60))
    end
  end)
end

return two_kinds
