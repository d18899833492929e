-- As probe.lua, of what drives and pulls: belts, wheels, turning cells and coils, under boxes, cylinders, spheres and magnets.
world { gravity = -9.81, dt = 1/240, iterations = 10, control_period = 1/60 }
material { name = 'default', friction = 0.4, rolling_friction = 0.01, restitution = 0.2 }
surface { rows = 16, columns = 16, actuators = { c = conveyor { lift = { 0, 0.2 } }, w = wheels { angle = 0.4 }, r = rotor { axis = { 0, 0, 1 }, half_axes = { 0.4, 0.4, 0.5 } }, m = magnet {} },
          cells = function(row, column) return row <= 5 and 'c' or row <= 9 and 'w' or row <= 12 and 'r' or 'm' end }
for k = 0, 3 do
  box { size = { 2 + 0.2 * k, 1.5, 0.8 }, position = { 3 + 3 * k, 12.5, 0.6 } }
  cylinder { radius = 0.9, height = 0.8, position = { 3 + 3 * k, 8, 0.6 } }
  sphere { radius = 0.7, position = { 3 + 3 * k, 5, 1 } }
  box { size = { 1, 1, 0.5 }, position = { 3 + 3 * k, 1.5, 0.4 }, moment = { 0, 0, k - 1 }, pole = 0.5 }
end
on_tick(function(t)
  for row = 1, 16 do
    for column = 1, 16 do
      local a = math.sin(2 * t + 0.7 * column + 0.3 * row)
      if row <= 5 then
        cells:target('drive_x', row, column, column < 8 and 1 or 2)
        cells:target('drive_y', row, column, 0.5 * a)
        cells:target('turn', row, column, t > 1 and 1 or 0)
        cells:target('lift', row, column, t > 2 and 0.1 or 0)
      elseif row <= 9 then
        cells:target('spin_a', row, column, 3)
        cells:target('spin_b', row, column, 2 * a)
      elseif row <= 12 then
        cells:target('rate', row, column, a)
      else
        cells:target('current', row, column, 0.3 * a)
      end
    end
  end
end)
