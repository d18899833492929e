-- A travelling wave: the script itself plays the controller and carries spheres east on its crests.
-- Run it with: smartsurf run scripts/examples/wave.lua --no-controller --window
world { seed = 1 }

surface { rows = 16, columns = 48,
          actuator = pin { range = { 0, 6 }, max_speed = 20 },
          sensors = { proximity { range = 8 } },
          border = { height = 6 } }

local wavelength = option('wavelength', 12.0, 'distance between two crests, u', { 1, 1000 })
local speed = option('speed', 3.0, 'of the crests, u/s', { -100, 100 })
local amplitude = option('amplitude', 1.0, 'half the height of the wave, u', { 0, 10 })
local seconds = option('seconds', 10, 'how long the run lasts, s')

for i = 1, option('count', 6, 'number of spheres', { 0, 6 }) do
  sphere { radius = 1.2, position = { 4, 2 + 12 * (i - 0.5) / 6, 5 }, colour = 'red', label = 'passenger' }
end

local heights = {}
on_tick(function(t)
  for column = 1, cells.columns do
    local phase = 2 * math.pi * ((column - 1) * cells.pitch - speed * t) / wavelength
    local height = 1.5 + amplitude * math.cos(phase)
    for row = 1, cells.rows do heights[(row - 1) * cells.columns + column] = height end
  end
  cells:targets('height', heights)
end)

on_finish(function()
  for _, passenger in ipairs(objects { label = 'passenger' }) do
    print(string.format('passenger %d went %.2f u east', passenger:id(), passenger:position() - 4))
  end
end)

at(seconds, stop)
