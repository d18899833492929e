-- Packages of three colours enter a table of 12×12 two-wheel cells in the west and leave by the exit of their colour:
-- red in the north, green in the east, blue in the south.
local count, gap = option('count', 12, 'packages', { 1, 10000 }), option('gap', 1.5, 'seconds between two of them', { 0.05, 1000 })
local pitch, size = 2, 2.4

world { off_table = 'remove' }
material { name = 'rubber', friction = 0.8 }
surface { rows = 12, columns = 12, pitch = pitch, material = 'rubber',
          actuator = wheels { top = 1.6, radius = 0.5, angle = math.rad(45), max_spin = 20 },
          sensors = { proximity { range = 3 }, colour { range = 3 } } }

local colours, entered, born, missed, took, touching, collisions = { 'red', 'green', 'blue' }, 0, {}, 0, {}, {}, 0
every(gap, function(t)
  local colour = colours[math.floor(random(1, 4))]
  local id = box { size = { size, size, 1 }, position = { 1, 11 + random(-0.5, 0.5), 0.6 }, material = 'rubber',
                   colour = colour, label = colour }
  born[id], entered = t, entered + 1
  return entered < count
end)

-- Two packages collide when their centres come nearer than their edge; each pair counts once.
on_tick(function()
  local all = objects()
  for i = 1, #all do
    for j = i + 1, #all do
      local x1, y1 = all[i]:position()
      local x2, y2 = all[j]:position()
      local pair = all[i]:id() .. '-' .. all[j]:id()
      if not touching[pair] and math.max(math.abs(x1 - x2), math.abs(y1 - y2)) < size + 0.02 then
        touching[pair], collisions = true, collisions + 1
      end
    end
  end
end)
on_leave(function(id, t)
  local x, y = object(id):position()
  local exit = ({ red = y > 22, green = x > 22, blue = y < 0 })[object(id):label()]
  if exit and math.abs((object(id):label() == 'green' and y - 11 or x - 15)) < 3 then
    took[#took + 1] = t - born[id]
  else
    missed = missed + 1
  end
end)
on_finish(function()
  local sum = 0
  for _, s in ipairs(took) do sum = sum + s end
  metric('success', #took == count and 1 or 0)
  metric('delivered', #took / count)
  if #took > 0 then metric('mean_delivery_s', sum / #took) end
  metric('wrong_exit', missed)
  metric('collisions', collisions)
end)

-- As a learning environment: docs/python.md.
local scored = 0
episode { seconds = 40 }
reward(function()
  local before = scored
  scored = #took - missed - collisions
  return scored - before
end)
success(function() return #took == count end)
info { delivered = function() return #took end, missed = function() return missed end,
       collisions = function() return collisions end }
