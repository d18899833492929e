-- Parcels from two infeeds merge on a table of 21×24 hexagons with three omnidirectional wheels each, and leave by the exit of
-- their colour: red in the north, green in the east, blue in the south.
local logistics = require 'logistics'
local count, gap = option('count', 24, 'number of parcels', { 1, 10000 }), option('gap', 2.0, 'seconds between two of them', { 0.05, 1000 })
local pitch, rows, columns = 2, 21, 24
local top_y, right_x = (rows - 1) * pitch * math.sqrt(3) / 2, (columns - 0.5) * pitch

world { off_table = 'remove' }
material { name = 'cardboard', friction = 0.6, rolling_friction = 0, density = 0.3 }
surface { rows = rows, columns = columns, pitch = pitch, layout = 'hex', material = 'cardboard',
          actuator = conveyor { top = 1.6, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 3 }, colour { range = 3 } } }

local meter, entered, right, wrong, parcels = logistics.new(4, 0.1), 0, 0, 0, {}
local exits = { red = { 31, top_y + 1 }, green = { right_x + 1, top_y / 2 }, blue = { 31, -1 } }
local colours = { 'red', 'green', 'blue' }
every(gap, function()
  local colour, from = colours[math.floor(random(1, 4))], random() < 0.5 and 1 or -1
  local length, width = random(2.2, 3.2), random(2, 2.6)
  local id = box { size = { length, width, 1 }, position = { 1, top_y / 2 + from * 8 + random(-0.5, 0.5), 0.55 },
                   orientation = { yaw = random(-0.3, 0.3) }, material = 'cardboard', colour = colour, label = colour }
  parcels[id], entered = { length = length, width = width }, entered + 1
  meter.aim(id, table.unpack(exits[colour]))
  return entered < count
end)
on_leave(function(id, t)
  local x, y = object(id):position()
  local exit = exits[object(id):label()]
  if math.abs(x - exit[1]) < 6 and math.abs(y - exit[2]) < 6 then
    right = right + 1
    meter.reached(id, t)
  else
    wrong = wrong + 1
  end
  meter.forget(id)
end)
on_tick(function(t)
  meter.update(t)
  local all = objects()
  for i, o in ipairs(all) do
    local p = parcels[o:id()]
    p.x, p.y = o:position()
    local qx, qy, qz, qw = o:orientation()
    p.heading = math.atan(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
    for j = 1, i - 1 do meter.pair(all[j]:id(), o:id(), logistics.gap(parcels[all[j]:id()], p)) end
  end
end)
episode { seconds = 80 }
success(function() return right == count end)
on_finish(function()
  meter.report()
  metric('success', right == count and 1 or 0)
  metric('wrong_exit', wrong)
end)
