-- The axis of a free cylinder turns about its angular momentum.
local truth = require 'truth'
local across, along = option('across', 3.0), option('along', 20.0)
truth.world { gravity = 0 }
surface { rows = 4, columns = 4, actuator = pin {} }
local id = cylinder { radius = 1, height = 0.4, position = { 1, 1, 50 }, angular_velocity = { across, 0, along } }
local I1, I3 = (3 + 0.4 ^ 2) / 12, 0.5
local l = { I1 * across, 0, I3 * along }
local ez = { l[1] / truth.norm(l), 0, l[3] / truth.norm(l) }
local ex = { ez[3], 0, -ez[1] }
local angle, before = 0, nil
truth.sample(function()
  local axis = truth.rotate(id, { 0, 0, 1 })
  local now = math.atan(axis[2], truth.dot(axis, ex))
  if before then
    local step = now - before
    angle = angle + step - 2 * math.pi * math.floor(step / (2 * math.pi) + 0.5)
  end
  before = now
end)
on_finish(function(t) metric('rate', angle / (t + truth.dt)) end)
