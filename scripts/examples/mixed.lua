-- A mixed surface: a lane of wheels between fields of pins, a hole in the middle, and the whole table on a slope.
surface { rows = 12, columns = 24,
          actuators = { p = pin { range = {0, 3} }, w = wheels { radius = 0.3 } },
          cells = function(row, column)
            if row >= 5 and row <= 8 then return 'w' end
            if column >= 12 and column <= 13 and row <= 2 then return nil end   -- nil: no cell there
            return 'p'
          end,
          tilt = {2, 0} }   -- degrees: the north edge is up, so that things slide south
box { size = {3, 3, 1}, position = {3, 5.5, 0.5}, colour = 'orange' }

on_tick(function()
  for row = 5, 8 do
    for column = 1, 24 do cells:target('spin_a', row, column, 8) end
  end
  for column = 1, 24 do
    cells:target('height', 4, column, 1.5)    -- rails
    cells:target('height', 9, column, 1.5)
  end
end)
on_finish(function() print(string.format('the box went %.2f u east', object(0):position() - 3)) end)
