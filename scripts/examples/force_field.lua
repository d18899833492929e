-- A squeeze field: all forces point to the middle line, so that a rod lies down along it, wherever and however it began.
-- Nothing is sensed. Run with force_field.aps.
material { name = 'slippery_table', friction = 0.1 }
surface { rows = 24, columns = 24, actuator = force_field { max_force = 4, reach = 1 }, material = 'slippery_table' }
local rod = box { size = {7, 1.6, 1}, position = {8, 11, 0.55}, orientation = {yaw = 1.1}, colour = 'purple',
                  material = 'slippery_table' }

on_finish(function()
  local x = object(rod):position()
  local qx, qy, qz, qw = object(rod):orientation()
  local yaw = 2 * math.atan(qz, qw) % math.pi
  print(string.format('the rod lies %.2f u from the line, turned %.2f rad from it', x - 11.5, yaw - math.pi / 2))
end)
