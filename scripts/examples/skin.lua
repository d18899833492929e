-- A skin over 8 × 8 pins carries an apple along a circle, and marbles far smaller than the gaps between pins. Run with
-- skin.aps.
material { name = 'latex', friction = 0.8, rolling_friction = 0.02, restitution = 0 }
surface { rows = 8, columns = 8, pitch = 2, material = 'latex', sensors = { skin_contact { resolution = 4 } },
          actuator = pin { top = {0.6, 0.6}, range = {0, 4}, max_speed = 4, max_acceleration = 100 },
          skin = { kind = 'kinematic', nodes = {64, 64} } }
sphere { radius = 1.2, position = {10, 7, 2}, material = 'latex', colour = 'red', label = 'apple' }
for i = 1, 3 do
  sphere { radius = 0.2, position = {6 + i, 4, 3}, material = 'latex', colour = 'blue', label = 'marble' }
end
local before, turns = nil, 0
every(0.1, function()
  local x, y = object(0):position()
  local angle = math.atan(y - 7, x - 7)
  if before then turns = turns + ((angle - before + math.pi) % (2 * math.pi) - math.pi) / (2 * math.pi) end
  before = angle
end)
on_finish(function()
  local x, y = object(0):position()
  print(string.format('the apple went round %.2f times, %.2f u from the middle', turns, math.sqrt((x - 7)^2 + (y - 7)^2)))
end)
