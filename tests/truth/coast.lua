-- A rolling sphere on level cells slows by rolling friction alone.
local truth = require 'truth'
local v, lever, radius, top = option('v', 6.0), option('lever', 0.0), option('radius', 1.5), option('top', 1.0)
truth.world {}
material { name = 'default', friction = 0.5, rolling_friction = lever, restitution = 0 }
surface { rows = 8, columns = 64, actuator = pin { top = top } }
local id = sphere { radius = radius, position = { 3, 3.3, radius }, velocity = { v, 0, 0 },
                    angular_velocity = { 0, v / radius, 0 } }
on_finish(function()
  metric('v', truth.velocity(id)[1])
  metric('x', truth.position(id)[1] - 3)
end)
