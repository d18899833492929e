-- A heavy plate on four light boxes: what the cells bear once all sleep, or have had time to.
local truth = require 'truth'
local mass = option('mass', 1000.0)
truth.world {}
material { name = 'default', friction = 0.5 }
surface { rows = 12, columns = 12, actuator = pin { top = 1 }, sensors = { pressure {} } }
for _, x in ipairs { 3.5, 7.5 } do
  for _, y in ipairs { 3.5, 7.5 } do box { size = { 1, 1, 1 }, mass = 1, position = { x, y, 0.5 } } end
end
local id = box { size = { 6, 6, 1 }, mass = mass, position = { 5.5, 5.5, 1.5 } }
on_finish(function()
  metric('load', truth.load())
  metric('sink', 1.5 - truth.position(id)[3])
  metric('speed', truth.norm(truth.velocity(id)))
end)
