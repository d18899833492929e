-- Unevenly filled objects: a loaded ball and a loaded capsule right themselves, and of two planks that lean over the edge of a
-- block only the one whose centre of mass is over it stays. Run with --no-controller.
material { name = 'wood', rolling_friction = 0.1 }
surface { rows = 16, columns = 16, material = 'wood' }

local upside_down = { axis = { 1, 0.3, 0 }, angle = 2.6 }
local ball = sphere { radius = 1, position = { 3, 4, 1.05 }, com = { 0, 0, -0.6 }, orientation = upside_down, material = 'wood', colour = 'red' }
local capsule = capsule { radius = 1, height = 2.2, position = { 8, 4, 1.15 }, com = { 0, 0, -0.6 }, orientation = upside_down, material = 'wood', colour = 'orange' }

local planks = {}
for i, beyond in ipairs { -0.1, 0.1 } do
  box { size = { 3, 2, 4 }, position = { 5, 7 + 4 * (i - 1), 2.01 }, fixed = true, colour = 'grey' }
  -- Three quarters of the plank are beyond the edge at x = 6.5; its centre of mass, not quite.
  planks[i] = box { size = { 4, 1, 0.5 }, position = { 7.5, 7 + 4 * (i - 1), 4.27 }, com = { beyond - 1, 0, 0 }, colour = 'brown' }
end

local function upright(id)
  local x, y = object(id):orientation()
  return 1 - 2 * (x * x + y * y)  -- the vertical part of its z axis
end
on_finish(function()
  print(('upright: ball %.3f, capsule %.3f'):format(upright(ball), upright(capsule)))
  local _, _, stays = object(planks[1]):position()
  local _, _, falls = object(planks[2]):position()
  print(('planks at %.2f and %.2f'):format(stays, falls))
end)
