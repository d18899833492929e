-- Transport by a travelling wave in a vibrating skin: how fast a plate goes at a frequency.
local frequency = option('frequency', 8.0, 'of the vibration, Hz')

surface { rows = 12, columns = 40, actuator = tile { frequency = frequency, max_amplitude = 0.1, thickness = 2 },
          sensors = { proximity { range = 4 } } }
box { size = {9, 6, 0.5}, position = { random(28, 32), random(5, 6), 0.4 }, colour = 'brown', label = 'plate' }

-- The speed from the second second on, when the plate goes steadily.
local from_x, from_t
at(1, function(t) from_x, from_t = object(0):position(), t end)
on_finish(function(t)
  if not from_t or t == from_t then return end
  local x = object(0):position()
  local speed = (from_x - x) / (t - from_t)
  local drag = 2 / 2 * 0.1 * (2 * math.pi / 8) * (2 * math.pi * frequency)   -- (thickness/2)·amplitude·k·omega
  metric('speed_u_s', speed)
  metric('share_of_crest_speed', speed / drag)
  metric('success', object(0):on_table() and speed >= 0.5 * drag and 1 or 0)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 10 }
reward(function() return -object(0):velocity() end)
info { plate = 0 }
