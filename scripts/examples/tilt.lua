-- Tiles with three degrees of freedom form a bowl, whose facets meet at their edges: a ball rolls to its middle, and a
-- crate stays where the slope holds it by friction. Run with tilt.aps.
material { name = 'felt', friction = 0.5, rolling_friction = 0.03 }
surface { rows = 9, columns = 9, pitch = 2,
          actuator = tile { command = 'pose', top = {1.9, 1.9}, heave = {0, 4}, max_speed = 1, max_tilt = 0.4 } }
sphere { radius = 0.8, position = {2, 6, 0.8}, material = 'felt', colour = 'red', label = 'ball' }
box { size = {1.2, 1.2, 0.8}, position = {8, 14, 0.4}, colour = 'brown', label = 'crate' }

on_finish(function()
  local function from_middle(id)
    local x, y = object(id):position()
    return math.sqrt((x - 8)^2 + (y - 8)^2)
  end
  print(string.format('from the middle: the ball %.2f u, the crate %.2f u', from_middle(0), from_middle(1)))
end)
