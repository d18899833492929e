-- Pins that rise at random under 14 bodies in a corner shovel them against a wall.
local truth = require 'truth'
local shape, seed = option('shape', 'box'), option('jam', 1)
truth.world { seed = seed }
record { objects = true, every = truth.rate // 60 }
surface { rows = 16, columns = 16, actuator = pin { max_speed = 10, max_acceleration = 200 }, border = { height = 6 } }
for i = 1, 14 do
  local position = { 2.5 + 1.9 * ((i - 1) % 4), 2.5 + 1.9 * ((i - 1) // 4), 1.6 + 0.3 * (i % 3) }
  local turned = { axis = { 0, 0, 1 }, angle = random(0, 1.5) }
  if shape == 'box' then
    box { size = { 1.6, 1.4, 1.2 }, position = position, orientation = turned }
  elseif shape == 'sphere' then
    sphere { radius = 0.8, position = position }
  else
    cylinder { radius = 0.7, height = 1.4, position = position, orientation = turned }
  end
end
-- A wall of pins that moves to the south-west corner, a column and a row at a time.
every(0.25, function(t)
  local step = math.floor(t / 0.25) % 14
  for r = 2, 15 do
    for c = 2, 15 do
      local x, y = c - 1, 16 - r
      local front = 15 - step
      cells:target('height', r, c, (x >= front or y >= front) and 4 or 0)
    end
  end
end)
