-- Over fixed boxes side by side: a ball that rolls, or a box that slides. What matters is that the seams do not.
local truth = require 'truth'
local body, speed = option('body', 'ball'), option('speed', 7.0)
truth.world { off_table = 'keep' }
material { name = 'default', friction = 0.2, restitution = 0 }
surface { rows = 4, columns = 32, actuator = pin {} }
for i = 0, 11 do box { size = { 2.5, 4, 1 }, position = { 1.25 + 2.5 * i, 1.5, 5.5 }, fixed = true } end
local id, rest
if body == 'ball' then
  rest = 6.4
  id = sphere { radius = 0.4, position = { 1, 1.5, rest }, velocity = { speed, 0, 0 },
                angular_velocity = { 0, speed / 0.4, 0 } }
else
  rest = 6.3
  id = box { size = { 1.3, 1, 0.6 }, position = { 1, 1.5, rest }, velocity = { speed, 0, 0 } }
end
local hop = 0
truth.sample(function() hop = math.max(hop, truth.position(id)[3] - rest) end)
on_finish(function()
  local p, east = truth.position(id), truth.rotate(id, { 1, 0, 0 })
  metric('v', truth.velocity(id)[1])
  metric('x', p[1] - 1)
  metric('y', p[2] - 1.5)
  metric('hop', hop)
  metric('turned', body == 'ball' and 0 or math.deg(math.acos(math.min(1, math.abs(east[1])))))
end)
