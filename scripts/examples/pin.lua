-- Pins roll a ball down a ramp, lift a light ball, and stall under one that is too heavy for them. Run with pin.aps.
surface { rows = 16, columns = 24, actuator = pin { range = {0, 4}, max_speed = 6, max_acceleration = 10, max_force = 200 } }
sphere { radius = 1.5, position = {3, 7.5, 1.5}, colour = 'red', label = 'ball' }
sphere { radius = 1.5, position = {17, 11, 1.5}, mass = 1, colour = 'green', label = 'light' }
sphere { radius = 1.5, position = {17, 4, 1.5}, mass = 300, colour = 'grey', label = 'heavy' }

on_finish(function()
  local x = object(0):position()
  local _, _, light = object(1):position()
  local _, _, heavy = object(2):position()
  print(string.format('the ball went %.2f u east; lifted by %.2f u: the light one, %.2f u: the heavy one', x - 3, light - 1.5,
                      heavy - 1.5))
end)
