-- Waves of an excitable medium drive the pins under three balls: how fast do they travel east?
material { name = 'felt', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 20, columns = 40, material = 'felt', border = { height = 6 },
          actuator = pin { range = {0, 6}, max_speed = 12, max_acceleration = 200 } }
for i = 1, 3 do
  sphere { radius = 1.5, material = 'felt', colour = 'green', label = 'ball',
           position = { random(5, 9), 5 * i - 0.5 + random(-0.5, 0.5), 3 } }
end

local goal, count, start, arrived = 34, 3, {}, {}
at(0, function() for id = 0, 2 do start[id] = object(id):position() end end)
on_tick(function(t)
  for id = 0, count - 1 do
    if not arrived[id] and object(id):position() > goal then arrived[id] = t end
  end
end)
on_finish(function(t)
  local done, speed = 0, 0
  for id = 0, count - 1 do
    if arrived[id] then done = done + 1 end
    speed = speed + (object(id):position() - start[id]) / (arrived[id] or t) / count
  end
  metric('success', done == count and 1 or 0)
  metric('speed_u_s', speed)
end)
