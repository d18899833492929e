-- Every sensor at once, and what noise and faults make of them: a weighed ball, a tilted box, and what they hide.
-- Run it with: smartsurf run scripts/examples/sensors.lua --no-controller
world { control_period = 1/60, seed = option('seed', 1, 'of the noise') }

local noise = option('noise', 0.0, 'deviation of the distances, u')

surface { rows = 16, columns = 16, actuator = pin { range = { 0, 4 } },
          sensors = { proximity { range = 8, noise = noise },
                      proximity { name = 'east', direction = { 1, 0, 0 }, origin = { 0.4, 0, 0.5 }, range = 6 },
                      colour {}, object_type {}, light { direction = { 1, 0, 1 } }, pressure {},
                      camera { resolution = 2 } } }

sphere { radius = 2, position = { 5, 8, 2 }, mass = 10, colour = '#ff8000', label = 'ball' }
box { size = { 3, 3, 1 }, position = { 11, 8, 4 }, orientation = { axis = { 0, 1, 0 }, angle = 0.3 }, fixed = true,
      colour = '#0080ff', label = 'lid' }

-- The cell of row r and column c is at x = c - 1, y = 16 - r.
at(1, function()
  local weight = 0
  for r = 1, 16 do
    for c = 1, 16 do weight = weight + cells:sense('pressure', r, c) end
  end
  print(string.format('weight %.2f, by its mass %.2f', weight, 10 * 9.81))
  print(string.format('under the lid: %.3f u, read as %.3f', cells:truth('proximity', 8, 12), cells:sense('proximity', 8, 12)))
  print(string.format('from the west the ball is %.3f u away', cells:sense('east', 8, 2)))
  print(string.format('colour of the lid: %.2f %.2f %.2f', cells:sense('colour', 8, 12)))
  print('its type:', cells:sense('object_type', 8, 12))
end)

at(1.1, stop)
