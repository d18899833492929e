-- Widgets as mechanisms on a table of pins: a slider that stays where the finger leaves it, a knob that springs back, and a
-- bell, whose hammer a pin throws up. Run with --no-controller.
surface { rows = 12, columns = 12, actuator = pin { range = { 0, 2 } } }

local slider = box { size = { 1, 1, 0.6 }, position = { 2, 9, 0.35 }, colour = 'red', label = 'slider' }
local groove = joint { kind = 'slider', a = slider, anchor = { 2, 9, 0.35 }, axis = { 1, 0, 0 }, limits = { 0, 7 }, friction = 3 }

local knob = cylinder { radius = 1, height = 0.6, position = { 6, 6, 0.35 }, colour = 'blue', label = 'knob' }
local shaft = joint { kind = 'hinge', a = knob, anchor = { 6, 6, 0.35 }, axis = { 0, 0, 1 }, spring = { stiffness = 8, damping = 2 } }

local hammer = box { size = { 4, 0.6, 0.2 }, position = { 4, 2, 0.15 }, colour = 'grey', label = 'hammer' }
joint { kind = 'hinge', a = hammer, anchor = { 6, 2, 0.15 }, axis = { 0, 1, 0 }, limits = { 0, 1.4 } }
local bell = sphere { radius = 0.5, position = { 4.2, 2, 3 }, colour = 'yellow', label = 'bell' }
joint { kind = 'ball', a = bell, anchor = { 4.2, 2, 5.4 } }

-- A finger pushes the slider for a second, then turns the knob for one.
local reached, turned, struck = 0, 0, 0
on_tick(function(t)
  if t < 1 then object(slider):push { force = { 4.5, 0, 0 } } end
  if t >= 1 and t < 2 then object(knob):push { force = { 0, 4, 0 }, point = { 7, 6, 0.35 } } end
  local vx, vy, vz = object(bell):velocity()
  struck = math.max(struck, math.sqrt(vx * vx + vy * vy + vz * vz))
end)
at(1.9, function() reached, turned = joint(groove):coordinate(), joint(shaft):coordinate() end)
at(2, function() cells:target('height', 10, 3, 2) end)
on_finish(function()
  print(('the slider went to %.2f and rests at %.2f'):format(reached, joint(groove):coordinate()))
  print(('the knob turned by %.1f degrees and is back at %.1f'):format(math.deg(turned), math.deg(joint(shaft):coordinate())))
  print(('the hammer made the bell swing with %.2f u/s'):format(struck))
end)
