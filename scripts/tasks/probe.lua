-- A little of everything that the tables' scenes move, so that its final state tells one physics from another.
world { gravity = -9.81, dt = 1/240, iterations = 10, control_period = 1/60 }
material { name = 'plastic', friction = 0.4, rolling_friction = 0.01, restitution = 0.2, density = 1.0 }
surface { rows = 16, columns = 16, actuator = pin { top = {0.8, 0.8}, length = 2, range = {0, 2}, max_speed = 4 },
          sensors = { proximity { range = 4 } }, border = { height = 4 }, material = 'plastic' }
for k = 0, 5 do
  sphere { radius = 0.6 + 0.1 * k, position = {3 + 1.8 * k, 4, 4}, material = 'plastic' }
  box { size = {1 + 0.1 * k, 1.2, 0.8}, position = {3 + 1.8 * k, 8, 4 + 0.3 * k}, material = 'plastic' }
  cylinder { radius = 0.5, height = 1 + 0.1 * k, position = {3 + 1.8 * k, 11.5, 4}, material = 'plastic' }
end
local heights = {}
on_tick(function(t)
  for row = 0, 15 do
    for column = 0, 15 do heights[16 * row + column + 1] = 0.5 + 0.5 * math.sin(3 * t + 0.7 * column + 0.3 * row) end
  end
  cells:targets('height', heights)
end)
