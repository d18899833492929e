-- Waves of an excitable medium drive the pins under three balls: how fast do they travel east?
material { name = 'felt', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 20, columns = 40, material = 'felt', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 12, max_acceleration = 200 },
          sensors = { proximity { range = 8 } } }
for i = 1, 3 do
  sphere { radius = 1.5, material = 'felt', colour = 'green', label = 'ball',
           position = { random(5, 9), 5 * i - 0.5 + random(-0.5, 0.5), 3 } }
end

local goal, start, speed, arrived = 34, {}, {}, 0
at(0, function() for id = 0, 2 do start[id] = object(id):position() end end)
on_tick(function(t)
  for id = 0, 2 do
    local x = object(id):position()
    if not speed[id] and x > goal and object(id):on_table() then speed[id], arrived = (x - start[id]) / t, arrived + 1 end
  end
end)
on_finish(function(t)
  local sum, on_table = 0, 0
  for id = 0, 2 do
    local x = object(id):position()
    sum = sum + (speed[id] or (x - start[id]) / t)
    if object(id):on_table() then on_table = on_table + 1 end
  end
  metric('success', arrived == 3 and on_table == 3 and 1 or 0)
  if t > 0 then metric('speed_u_s', sum / 3) end
end)

-- As a learning environment: docs/python.md.
episode { seconds = 30 }
reward(function()
  local sum = 0
  for id = 0, 2 do sum = sum + object(id):velocity() end
  return sum / 3
end)
success(function() return arrived == 3 end)
info { ball_1 = 0, ball_2 = 1, ball_3 = 2 }
