-- 500 mixed parcels enter a table of 64×64 two-wheel cells in the west; each leaves in the east, through the exit of its
-- colour: red in the north, green in the middle, blue in the south.
local count = option('count', 500, 'parcels', { 1, 100000 })
local gap = option('gap', 0.25, 'seconds between two of them', { 0.05, 1000 })
local side, pitch = 64, 2
local edge, infeeds = side * pitch, 16
local exits = { red = { 2 / 3, 1 }, green = { 1 / 3, 2 / 3 }, blue = { 0, 1 / 3 } }

world { off_table = 'remove' }
material { name = 'cardboard', friction = 0.6, density = 0.3 }
surface { rows = side, columns = side, pitch = pitch, material = 'cardboard',
          actuator = wheels { top = 1.6, radius = 0.5, angle = math.rad(45), max_spin = 20 },
          sensors = { proximity { range = 4 }, colour { range = 4 } } }

-- A carton, a drum, or a hexagonal box.
local function parcel(colour, y)
  local common = { position = { 4, y }, material = 'cardboard', colour = colour, label = colour }
  local kind = random()
  if kind < 0.7 then
    common.size = { random(2.4, 6), random(2.4, 4.5), random(1, 2.5) }
    common.orientation = { yaw = random(-math.pi, math.pi) }
    common.position[3] = common.size[3] / 2 + 0.05
    return box(common)
  elseif kind < 0.9 then
    common.radius, common.height = random(1.3, 2.2), random(1, 2)
    common.position[3] = common.height / 2 + 0.05
    return cylinder(common)
  end
  local points, h = {}, random(1, 2)
  for corner = 0, 5 do
    local angle, r = math.pi / 3 * corner, 2
    points[#points + 1] = { r * math.cos(angle), r * math.sin(angle), 0 }
    points[#points + 1] = { r * math.cos(angle), r * math.sin(angle), h }
  end
  common.points, common.position[3] = points, h / 2 + 0.05
  return hull(common)
end

local colours, born, entered, delivered, wrong, sum, last = { 'red', 'green', 'blue' }, {}, 0, 0, 0, 0, 0
-- An infeed sends a parcel when nothing lies before it.
local function free(y)
  for _, o in ipairs(objects()) do
    local ox, oy = o:position()
    if ox < 11 and math.abs(oy - y) < 7 then return false end
  end
  return true
end
every(gap, function(t)
  local first = math.random(infeeds)
  for k = first, first + infeeds - 1 do
    local y = edge * (k % infeeds + 0.5) / infeeds
    if free(y) then
      born[parcel(colours[math.random(3)], y)] = t
      entered = entered + 1
      return entered < count
    end
  end
end)
on_leave(function(id, t)
  local x, y = object(id):position()
  local from, to = table.unpack(exits[object(id):label()])
  if x > edge - pitch and y > from * edge - pitch / 2 and y < to * edge - pitch / 2 then
    delivered, sum, last = delivered + 1, sum + t - born[id], t
  else
    wrong = wrong + 1
  end
end)
local function most_delivered() return delivered >= 0.99 * count end
on_finish(function()
  metric('success', most_delivered() and 1 or 0)
  metric('delivered', delivered / count)
  metric('wrong_exit', wrong)
  if delivered > 0 then
    metric('parcels_per_minute', 60 * delivered / last)
    metric('mean_delivery_s', sum / delivered)
  end
end)

-- As a learning environment: docs/python.md.
local scored = 0
episode { seconds = 210 }
reward(function()
  local before = scored
  scored = delivered - wrong
  return scored - before
end)
success(most_delivered)
info { delivered = function() return delivered end, wrong = function() return wrong end }
