-- A box that covers n × n cells turns about the vertical; friction at every cell slows it.
local truth = require 'truth'
local n, spin, mu = option('n', 5), option('spin', 2.0), option('mu', 0.5)
truth.world {}
material { name = 'default', friction = mu, restitution = 0 }
surface { rows = n + 4, columns = n + 4, actuator = pin {} }
local middle = (n + 3) / 2
local id = box { size = { n, n, 1 }, position = { middle, middle, 0.5 }, angular_velocity = { 0, 0, spin } }
-- Within 0.1 rad of the start, where the covered cells are those of the start.
local first, last
truth.sample(function(t)
  if t >= 0.0166 and not first then first = { t, truth.spin(id)[3] } end
  if t <= 0.0501 then last = { t, truth.spin(id)[3] } end
end)
on_finish(function() metric('slowing', (first[2] - last[2]) / (last[1] - first[1])) end)
