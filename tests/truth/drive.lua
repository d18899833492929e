-- A box is driven by actuators whose tops move at (r·a, r·b): how it accelerates and where its speed ends.
local truth = require 'truth'
local model, a, b = option('model', 'ball'), option('a', 0.0), option('b', 5.0)
local angle, radius, mu = option('angle', 0.0), option('radius', 0.4), option('mu', 0.5)
truth.world {}
material { name = 'default', friction = mu, rolling_friction = 0, restitution = 0 }
local actuator, channels
if model == 'ball' then
  actuator, channels = ball { radius = radius, max_acceleration = 1e6 }, { 'spin_x', 'spin_y' }
elseif model == 'wheels' then
  actuator, channels = wheels { radius = radius, angle = math.rad(angle), max_acceleration = 1e6 }, { 'spin_a', 'spin_b' }
else
  actuator = rotor { half_axes = { radius, 0.5, radius }, axle = -radius, max_acceleration = 1e6 }
  channels = { 'rate' }
end
surface { rows = 16, columns = 32, actuator = actuator }
local id = box { size = { 3, 3, 1 }, position = { 6, 7, 0.5 } }
at(0, function()
  local values = { a, b }
  for i, name in ipairs(channels) do
    local all = {}
    for k = 1, cells.rows * cells.columns do all[k] = values[i] end
    cells:targets(name, all)
  end
end)
local early
truth.sample(function(t)
  if t <= 0.1 + 1e-9 then early = { t, truth.norm(truth.velocity(id)) } end
end)
on_finish(function()
  local v = truth.velocity(id)
  metric('gain', early[2] / early[1])
  metric('vx', v[1])
  metric('vy', v[2])
  metric('z', truth.position(id)[3] - 0.5)
end)
