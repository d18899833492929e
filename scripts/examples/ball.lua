-- Rolling balls carry a box east and turn it: run with ball.aps as the controller.
surface { rows = 16, columns = 24, actuator = ball { radius = 0.4, max_spin = 20 } }
box { size = {4, 3, 1}, position = {5, 7.5, 0.5}, colour = 'orange', label = 'parcel' }

on_finish(function()
  local x, y = object(0):position()
  print(string.format('the parcel went %.2f u east and %.2f u north', x - 5, y - 7.5))
end)
