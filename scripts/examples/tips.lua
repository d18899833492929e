-- Round, pointed and rounded fingertips: a ball rolls down a ramp of hemispheres without a top's edge to catch it, one ball
-- rests in a pocket of four cones, and pillars with rounded corners lift a crate. Run with tips.aps.
surface { rows = 12, columns = 24, actuators = {
            h = pin { range = {0, 4}, max_speed = 6, tip = { shape = 'hemisphere' } },
            c = pin { range = {0, 4}, max_speed = 6, tip = { shape = 'cone', half_angle = math.rad(40) } },
            r = pin { range = {0, 4}, max_speed = 6, tip = { shape = 'rounded_square', corner_radius = 0.2 } } },
          cells = function(row, column) return row <= 6 and 'h' or column <= 12 and 'c' or 'r' end }
sphere { radius = 1.5, position = {2.5, 8.5, 1.4}, colour = 'red', label = 'ball' }
sphere { radius = 0.6, position = {5.5, 2.5, 0.4}, colour = 'green', label = 'marble' }
box { size = {4.4, 3.4, 1}, position = {17.5, 2.5, 0.55}, colour = 'brown', label = 'crate' }

on_finish(function()
  local ball = object(0):position()
  local _, _, marble = object(1):position()
  local _, _, crate = object(2):position()
  print(string.format('the ball went %.2f u east; the marble lies %.3f u above the apexes; the crate stands at %.3f u',
                      ball - 2.5, marble, crate - 0.5))
end)
