-- A small table that is to be identified: pins with encoders, on which the script moves each pin by itself, in steps of all sizes.
-- With drive = 'ball' a ball falls into a bowl of pins and rolls to rest.
world { control_period = 0.01, dt = 0.0025, seed = option('seed', 1, 'of the commands and of the errors of sensors') }
material { name = 'rubber', friction = 0.6, rolling_friction = 0.05, restitution = 0.4 }
surface { rows = 10, columns = 10, material = 'rubber', border = { height = 6 },
          actuator = pin { range = { 0, 5 }, max_speed = 12, max_acceleration = 200 },
          sensors = { pin_height {}, proximity { range = 6 }, pressure {} } }
record { sensors = true, actuators = true }

local drive = option('drive', 'cells', 'what the script does: cells or ball')
if drive == 'ball' then
  sphere { radius = 1.3, mass = 3, position = { 2.8, 3.2, 5.5 }, material = 'rubber', label = 'ball' }
end

local heights, left = {}, {}
on_tick(function(_, tick)
  for cell = 1, cells.rows * cells.columns do
    if drive == 'ball' then
      local x, y = (cell - 1) % cells.columns - 4.5, (cell - 1) // cells.columns - 4.5
      heights[cell] = 0.8 + 0.09 * (x * x + y * y)
    else
      left[cell] = (left[cell] or 0) - 1
      if left[cell] <= 0 then
        local is_small = random() < 0.5
        local around = (heights[cell] or 2.5) + random(-0.3, 0.3)
        heights[cell] = is_small and math.min(4.5, math.max(0.5, around)) or random(0.5, 4.5)
        left[cell] = math.floor(is_small and random(3, 15) or random(20, 70))
      end
    end
  end
  cells:targets('height', heights)
end)
at(option('seconds', 12, 'length of the run, s'), quit)
