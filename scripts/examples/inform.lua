-- Pins of inFORM (Follmer and others, UIST 2013): 9.525 mm wide with gaps of 3.175 mm, 100 mm of travel, 1.08 N each. Weights in steps
-- of half a gram stand on every other pin; the heaviest that rises by 1 mm is the one that a pin lifts.
local force, least, step, count = option('force', 1.08, 'of a pin, N'), 0.1, 0.0005, 41
world { unit = 'mm' }
surface { rows = 1, columns = 2 * count, pitch = 12.7, actuator = pin { top = 9.525, range = { 0, 100 }, max_speed = 600, max_acceleration = 50,
                                                                        max_force = 1000 * force } }
local ids = {}
for i = 0, count - 1 do
  ids[i] = box { size = { 9, 9, 9 }, mass = least + i * step, position = { 2 * i * 12.7, 0, 4.6 } }
end
at(0.2, function() for i = 0, count - 1 do cells:target('height', 1, 2 * i + 1, 50) end end)
on_finish(function()
  local greatest = 0
  for i = 0, count - 1 do
    local _, _, z = object(ids[i]):position()
    if z > 5.5 then greatest = math.max(greatest, least + i * step) end
  end
  metric('lifted_g', 1000 * greatest)
end)
