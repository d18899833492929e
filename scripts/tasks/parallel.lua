-- Four balls travel at the same time, each to the wall of its colour, past a grey bystander that must stay where it is.
local n, radius = 40, 2
material { name = 'plastic', friction = 0.25 }
surface { rows = n, columns = n, material = 'plastic', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 6, max_acceleration = 60 },
          sensors = { proximity { range = 8 }, colour { range = 8 } } }

local function ball(label, x, y)
  return sphere { radius = radius, material = 'plastic', colour = label, label = label,
                  position = { x + random(-1, 1), y + random(-1, 1), 6.5 } }
end
-- The lanes of red and blue pass the bystander with three cells to spare.
local travellers = { ball('red', 5, 27.5), ball('blue', 34, 11.5), ball('green', 30, 17), ball('green', 9, 16) }
local bystander = ball('grey', 19.5, 19.5)

local function arrived(id)
  local x, y = object(id):position()
  local label = object(id):label()
  local beyond = ({ red = x, blue = n - 1 - x, green = y })[label]
  return object(id):on_table() and beyond > n - 3 - radius
end

local from_x, from_y, done_at
at(1, function() from_x, from_y = object(bystander):position() end)
on_tick(function(t)
  local count = 0
  for _, id in ipairs(travellers) do count = count + (arrived(id) and 1 or 0) end
  done_at = count == #travellers and (done_at or t) or nil
  if done_at and t > done_at + 2 then stop(string.format('done after %.1f s', done_at), true) end
end)
on_finish(function()
  local x, y = object(bystander):position()
  if done_at then metric('time_s', done_at) end
  local moved = from_x and math.sqrt((x - from_x)^2 + (y - from_y)^2) or 0
  metric('success', done_at and moved < 0.5 and object(bystander):on_table() and 1 or 0)
  metric('bystander_moved_u', moved)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 60 }
reward(function()
  local sum = 0
  for _, id in ipairs(travellers) do sum = sum + (arrived(id) and 1 or 0) end
  return sum / #travellers
end)
success(function(t) return done_at and t > done_at + 2 end)
info { red = travellers[1], blue = travellers[2], green_1 = travellers[3], green_2 = travellers[4],
       bystander = bystander }
