-- Discs and triangles on rolling balls under a camera: recognise.aps tells them apart by their outline alone and takes the
-- discs to the east, the triangles to the west.
world { seed = option('seed', 1, 'of the places and turns') }
local n = 48

surface { rows = n, columns = n, border = { height = 3 }, actuator = ball { radius = 0.4, max_spin = 20 },
          sensors = { camera {} } }

local corners = {}
for i = 0, 2 do
  for _, z in ipairs { -0.5, 0.5 } do
    table.insert(corners, { 5.5 * math.cos(2 * math.pi * i / 3), 5.5 * math.sin(2 * math.pi * i / 3), z })
  end
end
for i = 1, 4 do
  local place = { random(18, 29), 12 * i - 6, 0.6 }
  if i % 2 == 0 then
    cylinder { radius = 4.5, height = 1, position = place, colour = 'orange', label = 'disc' }
  else
    hull { points = corners, position = place, orientation = { yaw = random(0, 2 * math.pi) }, colour = 'orange',
           label = 'triangle' }
  end
end

on_finish(function()
  for _, kind in ipairs { 'disc', 'triangle' } do
    for _, part in ipairs(objects { label = kind }) do
      print(string.format('%s at %.1f, %.1f', kind, part:position()))
    end
  end
end)
