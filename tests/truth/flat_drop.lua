-- A box falls flat onto level cells.
local truth = require 'truth'
local v, e = option('v', 20.0), option('e', 0.2)
truth.world {}
material { name = 'default', friction = 0.5, restitution = e }
surface { rows = 12, columns = 12, actuator = pin {} }
local id = box { size = { 3, 3, 1 }, position = { 5.3, 5.2, 2.013 }, velocity = { 0, 0, -v } }
local aside, spin, up = 0, 0, 0
truth.sample(function()
  local u = truth.velocity(id)
  aside = math.max(aside, math.sqrt(u[1] ^ 2 + u[2] ^ 2))
  spin = math.max(spin, truth.norm(truth.spin(id)))
  up = math.max(up, u[3])
end)
on_finish(function()
  metric('aside', aside)
  metric('spin', spin)
  metric('up', up)
end)
