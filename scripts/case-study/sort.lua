-- The case study of the paper: a 64×64 surface of pins, a wall around it, and spheres of two sizes dropped at random.
-- Small spheres belong in the western half, large ones in the eastern. Run it with sort.aps as the controller.

local small_count  = option('small', 20, 'number of small spheres', { 0, 1000 })
local large_count  = option('large', 20, 'number of large spheres', { 0, 1000 })
local small_radius = option('small_radius', 2.0, 'radius of the small spheres')
local large_radius = option('large_radius', 4.0, 'radius of the large spheres')
local pin_speed    = option('pin_speed', 6.0, 'greatest speed of a pin, u/s')
local pin_acceleration = option('pin_acceleration', 60.0, 'greatest acceleration of a pin, u/s²')
local dead_sensors = option('dead_sensors', 0.0, 'fraction of the sensors that report nothing')
local dropout      = option('dropout', 0.0, 'fraction of the readings that report nothing')
local false_hits   = option('false_hits', 0.0, 'fraction of the readings without an object that report one')
local restitution  = option('restitution', 0.1, 'restitution of spheres and pins')
local spread       = option('spread', 0.0, 'by which share of its radius a sphere differs from others of its size, at most', { 0, 0.9 })
local stuck_pins   = option('stuck_pins', 0.0, 'fraction of the pins that stand still at a random height')
local hold         = option('hold', 5.0, 'seconds of sortedness after which the run ends; 0 = run on', { 0, 1000000 })

local rows, columns, up, wall = 64, 64, 4.0, 6.0

world { gravity = -9.81, dt = 1/240, iterations = 10, control_period = 1/60 }

material { name = 'plastic', friction = 0.25, rolling_friction = 0.01, restitution = restitution, density = 1.0 }

surface { rows = rows, columns = columns, pitch = 1.0,
          actuator = pin { top = {0.8, 0.8}, length = 2.0, range = {0, wall},
                           max_speed = pin_speed, max_acceleration = pin_acceleration },
          sensors  = { proximity { range = 8 } },
          border   = { height = wall },
          material = 'plastic' }

faults { sensor = { dead = dead_sensors, dropout = dropout, false_hits = false_hits }, actuator = { stuck = stuck_pins } }

record { objects = true, every = 2 }

-- Drop the spheres where none overlaps another; the crowded ones from a layer higher, far enough from the wall that they do
-- not roll over it.
local placed = {}
local function free(x, y, z, r)
  for _, p in ipairs(placed) do
    local dx, dy, dz, gap = p.x - x, p.y - y, p.z - z, p.r + r + 0.2
    if dx*dx + dy*dy + dz*dz < gap*gap then return false end
  end
  return true
end

local function drop(radius, label, colour)
  if spread > 0 then radius = radius * random(1 - spread, 1 + spread) end
  local z, margin, tries = up + radius + 1.0, 1.0 + radius, 0
  local x, y
  repeat
    x, y = random(margin, columns - 1 - margin), random(margin, rows - 1 - margin)
    tries = tries + 1
    if tries % 500 == 0 then z, margin = z + 2 * radius + 1, 1 + 3 * radius end
  until free(x, y, z, radius)
  placed[#placed + 1] = { x = x, y = y, z = z, r = radius }
  sphere { radius = radius, position = {x, y, z}, material = 'plastic', colour = colour, label = label }
end

for _ = 1, large_count do drop(large_radius, 'large', '#d55e00') end
for _ = 1, small_count do drop(small_radius, 'small', '#0072b2') end

-- Purity: the share of spheres in their own half. Sorted: at least 0.95 for five seconds on end.
local middle = (columns - 1) / 2
local function purity()
  local right, all = 0, 0
  for label, sign in pairs { small = -1, large = 1 } do
    for _, o in ipairs(objects { label = label }) do
      all = all + 1
      local x, y, z = o:position()
      local on_surface = x > -0.5 and x < columns - 0.5 and y > -0.5 and y < rows - 0.5 and z > 0
      if on_surface and sign * (x - middle) > 0 then right = right + 1 end
    end
  end
  return all > 0 and right / all or nil
end

local since, sorted_at
metric('purity', function(t)
  local now = purity()
  since = now and now >= 0.95 and (since or t) or nil
  if since and t - since >= 5 - 1e-9 then sorted_at = sorted_at or since end
  return now
end)
success(function() return sorted_at end)

if hold > 0 then
  on_tick(function(t)
    if since and t - since >= hold + 0.1 then
      print(string.format('sorted at %.1f s', since))
      stop(string.format('sorted: %.0f %% after %.1f s', 100 * purity(), since), true)
    end
  end)
end
