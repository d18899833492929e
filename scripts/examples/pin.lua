-- Pins lift a ball over a step and stall under a weight that is too heavy for them. Run with pin.aps.
surface { rows = 16, columns = 24, actuator = pin { range = {0, 4}, max_speed = 6, max_acceleration = 40, max_force = 40 } }
sphere { radius = 1.5, position = {3, 7.5, 1.5}, colour = 'red', label = 'ball' }
box { size = {4, 4, 4}, position = {18.5, 7.5, 2}, mass = 300, colour = 'grey', label = 'weight' }

on_finish(function()
  local x = object(0):position()
  local _, _, z = object(1):position()
  print(string.format('the ball went %.2f u east, the weight was lifted by %.2f u', x - 3, z - 2))
end)
