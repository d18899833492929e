-- A travelling wave of pins carries a ball; how fast depends on its shape.
local amplitude = option('amplitude', 0.5, 'half of the wave height, u', { 0, 1 })
local wavelength = option('wavelength', 8.0, 'u', { 1, 1000 })
local frequency = option('frequency', 1.0, 'Hz', { 0, 100 })

surface { rows = 8, columns = 32, actuator = pin { range = {0, 2}, max_speed = 8, max_acceleration = 200 }, border = { height = 4 } }
local start = random(4, 8)
local ball = sphere { radius = 1, position = {start, random(2, 5), 3} }

on_tick(function(t)
  for column = 2, 31 do
    local height = 1 + amplitude * math.sin(2 * math.pi * (column / wavelength - frequency * t))
    for row = 2, 7 do cells:target('height', row, column, height) end
  end
end)
on_finish(function()
  metric('speed_u_s', (object(ball):position() - start) / 6)
end)
