-- Boxes of graded friction on one slope: those that slide tell the angle of friction.
local truth = require 'truth'
local angle = option('angle', 26.565)
truth.world { gravity = truth.slope(angle) }
material { name = 'default', friction = 1.0, restitution = 0 }
surface { rows = 64, columns = 32, actuator = pin {} }
local ids, offsets = {}, {}
-- Box i rests if the slope is less steep than the angle of friction, angle + offset.
for i = 1, 20 do
  offsets[i] = -0.5 + 0.05 * (i - 0.5)
  local mu = math.tan(math.rad(angle + offsets[i]))
  material { name = 'm' .. i, friction = mu ^ 2, restitution = 0 }
  ids[i] = box { size = { 2, 2, 0.5 }, material = 'm' .. i,
                 position = { 4 + 14 * ((i - 1) // 10), 3.2 + 6 * ((i - 1) % 10), 0.25 } }
end
local start = {}
at(1, function() for i, id in ipairs(ids) do start[i] = truth.position(id)[1] end end)
on_finish(function(t)
  -- Between the last that slides as it should and the first that rests.
  local slid, wrong = -0.5, 0
  for i, id in ipairs(ids) do
    local moved = truth.position(id)[1] - start[i] > 0.002
    if moved then slid = math.max(slid, offsets[i] + 0.025) end
    if moved ~= (offsets[i] < 0) then wrong = wrong + 1 end
  end
  metric('angle', angle + slid)
  metric('wrong', wrong)
end)
