-- Magnetic widgets on an 8×8 table of electromagnets: a slider between rails and a knob between posts are set by the
-- program, and the slider resists a finger as long as its coil holds it. Run with widgets.aps.
surface { rows = 8, columns = 8, pitch = 2, actuator = magnet { top = 1.6, strength = 150, depth = 1, law = 'pole' } }
material { name = 'smooth', friction = 0.02 }
for _, y in ipairs { 10.8, 13.2 } do
  box { size = { 15, 0.4, 1 }, position = { 7, y, 0.5 }, fixed = true, colour = 'grey', label = 'rail' }
end
for quarter = 0, 3 do
  local a = math.rad(90 * quarter + 45)
  cylinder { radius = 0.2, height = 1, position = { 6 + 1.15 * math.cos(a), 4 + 1.15 * math.sin(a), 0.5 },
             fixed = true, colour = 'grey', label = 'post' }
end
local slider = cylinder { radius = 0.9, height = 0.6, position = { 2, 12, 0.3 }, pole = 1, colour = 'red', label = 'slider' }
local knob = cylinder { radius = 0.9, height = 0.6, position = { 6, 4, 0.3 }, material = 'smooth', moment = { 0.6, 0, 0 }, colour = 'blue', label = 'knob' }

-- A finger pushes the slider from 4 s and, once the coils are off, from 6 s, half a second each.
local from = 2
local function push(at_s)
  at(at_s, function() from = object(slider):position() end)
  on_tick(function(t)
    if t >= at_s and t < at_s + 0.5 then object(slider):push { force = { -20, 0, 0 } } end
  end)
end
push(4)
push(6)

at(4, function()
  local _, _, z, w = object(knob):orientation()
  print(string.format('the slider is at %.2f, the knob at %.1f degrees', from, math.deg(2 * math.atan(z, w))))
end)
at(5, function() print(string.format('held, it gave way by %.2f', from - object(slider):position())) end)
on_finish(function() print(string.format('let go, by %.2f', from - object(slider):position())) end)
