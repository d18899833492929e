-- Twelve balls fly against a thin fixed wall from distances that differ by parts of a step: how many pass, and at which
-- speeds they leave.
local truth = require 'truth'
local speed, thickness, e = option('speed', 100.0), option('thickness', 0.05), option('e', 0.0)
truth.world { gravity = { 0, 0, 0 }, off_table = 'keep' }
material { name = 'default', friction = 0.5, restitution = e }
surface { rows = 4, columns = 4, actuator = pin {} }
box { size = { thickness, 30, 4 }, position = { 10, 12, 20 }, fixed = true }
local balls = {}
for i = 1, 12 do
  balls[i] = sphere { radius = 0.1, position = { 5 + speed / 720 * i, 2 * i - 1, 20 }, velocity = { speed, 0, 0 } }
end
on_finish(function()
  local passed, least, greatest = 0, math.huge, -math.huge
  for _, id in ipairs(balls) do
    if truth.position(id)[1] > 10 then passed = passed + 1 end
    local v = -truth.velocity(id)[1]
    least, greatest = math.min(least, v), math.max(greatest, v)
  end
  metric('passed', passed)
  metric('least', least)
  metric('greatest', greatest)
end)
