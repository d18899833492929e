-- Thousands of objects of every simple shape, poured onto a table whose pins heave under them.
-- Run it with: smartsurf run scripts/examples/pour.lua --no-controller --window --set count=500
local count = option('count', 4000, 'number of objects', { 1, 100000 })
local cells_a_side = option('cells', 96, 'rows and columns of the table')
local swell = option('swell', 1.0, 'half the height of the waves, u', { 0, 3 })
local seconds = option('seconds', 10, 'how long the run lasts, s')

world { seed = 1 }

surface { rows = cells_a_side, columns = cells_a_side,
          actuator = pin { range = { 0, 6 }, max_speed = 10 },
          border = { height = 6 } }

local colours = { '#0072b2', '#d55e00', '#009e73', '#e69f00', '#cc79a7', '#56b4e9' }

-- In layers over the middle of the table, each object a little beside its place.
local across = math.max(1, math.floor(0.7 * cells_a_side / 2.6))
for i = 0, count - 1 do
  local layer, place = i // (across * across), i % (across * across)
  local start = (cells_a_side - 1) / 2 - 1.3 * (across - 1)
  local at = { start + 2.6 * (place % across) + random(-0.3, 0.3), start + 2.6 * (place // across) + random(-0.3, 0.3),
               7 + 2.6 * layer }
  local colour, turn = colours[1 + i % #colours], { roll = random(0, 3), pitch = random(0, 3), yaw = random(0, 3) }
  local kind = math.random(4)
  if kind == 1 then sphere { radius = random(0.6, 1.2), position = at, colour = colour }
  elseif kind == 2 then box { size = { random(1, 1.8), random(1, 1.8), random(1, 1.8) }, position = at, orientation = turn, colour = colour }
  elseif kind == 3 then cylinder { radius = random(0.5, 0.8), height = random(1, 1.8), position = at, orientation = turn, colour = colour }
  else capsule { radius = random(0.4, 0.6), height = random(1.4, 2), position = at, orientation = turn, colour = colour } end
end

local heights, wave = {}, {}
on_tick(function(t)
  for column = 1, cells.columns do wave[column] = swell * math.sin(0.25 * column - 1.5 * t) end
  for row = 1, cells.rows do
    local first, share = (row - 1) * cells.columns, math.cos(0.2 * row)
    for column = 1, #wave do heights[first + column] = 2 + wave[column] * share end
  end
  cells:targets('height', heights)
end)

at(seconds, stop)
