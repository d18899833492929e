-- Boxes fall into a pit and come to rest.
local truth = require 'truth'
local count = option('count', 60)
truth.world {}
record { objects = true, every = truth.rate }
surface { rows = 12, columns = 12, actuator = pin {}, border = { height = 6 } }
for i = 1, count do
  local k = i - 1
  box { size = { 1.4, 1.2, 1 }, position = { 2.4 + 1.8 * (k % 4) + random(0, 0.2), 2.4 + 1.8 * (k // 4 % 4), 1 + 1.7 * (k // 16) },
        orientation = { axis = { 0, 0, 1 }, angle = random(0, 3) } }
end
