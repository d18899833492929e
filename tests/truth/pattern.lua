-- A plate on 7×7 cells, of which a part drives east; the others brake.
local truth = require 'truth'
local pattern, mu, v = option('pattern', 'inner'), option('mu', 0.5), option('v', 5.0)
truth.world {}
material { name = 'default', friction = mu, rolling_friction = 0, restitution = 0 }
surface { rows = 13, columns = 13, actuator = ball { radius = 0.4, max_acceleration = 1e6 } }
local id = box { size = { 7, 7, 1 }, position = { 6, 6, 0.5 } }
at(0, function()
  for r = 1, 13 do
    for c = 1, 13 do
      local x, y = math.abs(c - 7), math.abs(r - 7)
      local drives
      if pattern == 'inner' then drives = math.max(x, y) <= 2
      elseif pattern == 'rim' then drives = math.max(x, y) == 3
      else drives = r % 2 == 0 end  -- rows 4, 6, 8 and 10 of the plate's seven: no couple turns it
      if drives then cells:target('spin_y', r, c, v / 0.4) end
    end
  end
end)
local a, b
truth.sample(function(t)
  if t <= 0.1 + 1e-9 then a = { t, truth.velocity(id)[1] } end
  if t <= 0.4 + 1e-9 then b = { t, truth.velocity(id)[1] } end
end)
on_finish(function()
  metric('gain', (b[2] - a[2]) / (b[1] - a[1]))
  metric('v', truth.velocity(id)[1])
end)
