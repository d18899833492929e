-- 64 delta robots on compliant tips walk a plate to the goal, by the forces that they feel. Run with delta.aps.
surface { rows = 8, columns = 8, pitch = 2, sensors = { tip_force {}, joint_position {} },
          actuator = delta { tip = { radius = 0.4 }, workspace = { radius = 0.8, z = {0.6, 1.8} },
                             max_speed = 8, stiffness = 300, damping = 20, max_force = 60 } }
box { size = {5, 5, 0.6}, position = {4, 4, 1.8}, mass = 5, colour = 'brown', label = 'plate' }
on_finish(function()
  local x, y, z = object(0):position()
  print(string.format('the plate is %.2f u from the goal, at %.2f u', math.sqrt((x - 11)^2 + (y - 11)^2), z))
end)
