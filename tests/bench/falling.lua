-- 10 000 spheres fall on 1024×1024 pins, and each pin senses upwards. Run with falling.aps.
surface { rows = 1024, columns = 1024, actuator = pin { range = { 0, 4 }, max_speed = 4 }, sensors = { proximity { range = 4 } } }
for i = 0, 9999 do
  sphere { radius = random(1.5, 3), position = { 17 + i % 100 * 10, 17 + i // 100 * 10, random(20, 200) } }
end
