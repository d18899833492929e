-- An elastic skin, clamped at its edge, falls from the level and swings in its lowest mode.
local truth = require 'truth'
local tension, density, ratio = option('tension', 63.0), option('density', 1.0), option('ratio', 1e-4)
truth.world {}
surface { rows = 8, columns = 8, actuator = pin { range = { 0, 1 }, top = { 0.1, 0.1 } },
          mask = { 'x......x', '........', '........', '........', '........', '........', '........', 'x......x' },
          skin = { kind = 'elastic', attached = true, nodes = { 33, 33 }, margin = 0.5, edge = { height = 0 },
                   tension = tension, density = density, damping = ratio * tension }, sensors = { skin_height {} } }
-- The share of the lowest mode: the others vanish in the sum.
local swing = truth.swing(function()
  local sum = 0
  for r = 1, 8 do
    for c = 1, 8 do
      sum = sum + math.sin(math.pi * (r - 0.5) / 8) * math.sin(math.pi * (c - 0.5) / 8) * cells:truth('skin_height', r, c)
    end
  end
  return sum / 16
end)
on_finish(function()
  metric('rate', swing.decrement() / swing.period())
  metric('period', swing.period())
end)
