-- Vibrating cells under a flexible skin, with light sensors: where a plate shades them a travelling wave runs east, and its
-- crests carry the plate west. Run with tile.aps.
surface { rows = 16, columns = 32, sensors = { light {} }, actuator = tile { frequency = 8, max_amplitude = 0.1, skin = 0.3, thickness = 2 } }
box { size = {9, 6, 0.5}, position = {20, 7.5, 0.4}, colour = 'brown', label = 'plate' }

on_finish(function() print(string.format('the plate went %.2f u west', 20 - object(0):position())) end)
