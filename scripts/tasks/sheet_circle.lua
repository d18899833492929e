-- A soft skin, which feels loads, hangs on 3×3 actuators half a metre apart, the corners of 2×2 modules. An apple is to go round
-- on a circle, from module to module. Each seed is another apple: its size, its centre of mass, and where it starts.
local modules = option('modules', 2, 'modules in a row', { 2, 12 })
local tension = option('tension', 500, 'tension of the skin, N/m')
local eccentricity = option('eccentricity', 0.05, 'greatest distance of the centre of mass from the centre, radii', { 0, 1 })
local per_module, pitch = 20, 2.5  -- cells, cm
local size = per_module * pitch    -- of a module
local side, middle = modules * size, modules * size / 2
local circle = 0.6 * size * (modules - 1)  -- radius, cm
local rest = 15                            -- height of the skin, cm

world { unit = 'cm', dt = 1/120 }
material { name = 'fabric', friction = 0.8, rolling_friction = 0.02, restitution = 0 }
local cells, nodes = modules * per_module + 1, 2 * modules * per_module + 1
surface { rows = cells, columns = cells, pitch = pitch, material = 'fabric', sensors = { skin_contact {} },
          actuator = pin { top = {1, 1}, range = {0, 2 * rest}, max_speed = 60, max_acceleration = 1000 },
          mask = function(row, column) return row % per_module == 1 and column % per_module == 1 end,
          skin = { kind = 'elastic', attached = true, margin = 0, nodes = {nodes, nodes}, tension = tension, density = 3e-5 } }

local radius = random(3.5, 4.5)
local off, z, angle = random(0, eccentricity) * radius, random(-1, 1), random(-math.pi, math.pi)
local across = off * math.sqrt(1 - z * z)
local apple = sphere { radius = radius, mass = 8.5e-4 * 4 / 3 * math.pi * radius ^ 3, material = 'fabric', colour = 'red', label = 'apple',
                       com = { across * math.cos(angle), across * math.sin(angle), off * z },
                       position = { random(20, side - 20), random(20, side - 20), rest + radius } }

-- The module over which the apple is, row by row; within 2 cm of the line between two, the one where it was.
local module
local function module_of(x, y)
  local column, row = math.floor(x / size), math.floor(y / size)
  local margin = size / 2 - math.max(math.abs(x - (column + 0.5) * size), math.abs(y - (row + 0.5) * size))
  return margin < 2 and module or row * modules + column
end
local settle = 5  -- s, to reach the circle
local before, turned, hand_overs, distances, ticks = nil, 0, 0, 0, 0
local function distance()  -- from the circle
  local x, y = object(apple):position()
  return math.abs(math.sqrt((x - middle) ^ 2 + (y - middle) ^ 2) - circle)
end
on_tick(function(t)
  local x, y = object(apple):position()
  local angle = math.atan(y - middle, x - middle)
  if before then turned = turned + (angle - before + math.pi) % (2 * math.pi) - math.pi end
  before = angle
  local now = module_of(x, y)
  if module and now ~= module then hand_overs = hand_overs + 1 end
  module = now
  if t > settle then distances, ticks = distances + distance(), ticks + 1 end
end)
local function laps() return turned / (2 * math.pi) end
local function succeeds() return laps() >= 2 and distances < 2 * ticks and object(apple):on_table() end
on_finish(function()
  metric('laps', laps())
  metric('hand_overs', hand_overs)
  if ticks > 0 then metric('error_cm', distances / ticks) end
  metric('success', succeeds() and 1 or 0)
end)

-- As a learning environment: docs/python.md.
local scored = 0
episode { seconds = 40 }
reward(function()
  local before = scored
  scored = laps()
  return 10 * (scored - before) - distance() / circle / 60
end)
success(succeeds)
info { laps = laps, hand_overs = function() return hand_overs end }
