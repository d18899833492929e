-- A small ball falls on top of a large one.
local truth = require 'truth'
local e, m, gap = option('e', 1.0), option('m', 0.25), option('gap', 0.02)
truth.world {}
material { name = 'default', friction = 0, restitution = e }
surface { rows = 8, columns = 8, actuator = pin { top = 1 } }
local big = sphere { radius = 1, mass = 1, position = { 3.5, 3.5, 2 } }
local small = sphere { radius = 0.5, mass = m, position = { 3.5, 3.5, 3.5 + gap } }
local speed, after = 0, 0
truth.sample(function()
  local v = truth.velocity(small)[3]
  speed = math.max(speed, -v)
  after = math.max(after, v)
end)
on_finish(function() metric('ratio', after / math.sqrt(2 * truth.g)) end)
