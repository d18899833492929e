-- A box on pins at random heights: its load, and how far it creeps once it lies.
local truth = require 'truth'
truth.world { seed = option('bed', 1) }
material { name = 'default', friction = 0.5 }
surface { rows = 12, columns = 12, sensors = { pressure {} },
          actuator = pin { range = { 0, 3 }, max_speed = 20, max_acceleration = 1000 } }
local heights = {}
for i = 1, 144 do heights[i] = 1 + random(-0.1, 0.1) end
at(0, function() cells:targets('height', heights) end)
local id
at(1, function() id = box { size = { 5, 5, 1 }, mass = 25, position = { 5.5, 5.5, 1.7 } } end)
local load, ticks, from = 0, 0, nil
truth.sample(function(t)
  if t < 10 then return end
  from = from or truth.position(id)
  if t >= 20 then load, ticks = load + truth.load(), ticks + 1 end
end)
on_finish(function()
  if ticks == 0 then return end  -- a shorter run has nothing to measure
  metric('load', load / ticks)
  metric('creep', truth.norm(truth.sub(truth.position(id), from)))
end)
