-- A polygon on the tips of 8×8 delta robots is to lie in the middle with its long axis along the rows. Each seed is another
-- polygon. It is sensed at nine points of each cell.
local pitch, middle = 2, 7
local points = {}  -- where a cell's sensors stand: 3 × 3, row by row from the north-west
for k = 0, 8 do
  points[k + 1] = proximity { name = 'p' .. k, origin = { (k % 3 - 1) * 2 / 3, (1 - k // 3) * 2 / 3, 0 }, range = 4, pins = false }
end
surface { rows = 8, columns = 8, pitch = pitch, sensors = points,
          actuator = delta { tip = { radius = 0.4 }, workspace = { radius = 0.8, z = { 0.6, 1.8 } },
                             max_speed = 8, stiffness = 300, damping = 20, max_force = 60 } }

-- The corners of a convex polygon of 3 to 8 sides in an ellipse of 10 × 6 u, its centroid, and the angle of its long axis.
local function polygon()
  local corners, sides, start = {}, math.random(3, 8), random(0, 2 * math.pi)
  for k = 1, sides do
    local angle = start + (k + random(-0.2, 0.2)) * 2 * math.pi / sides
    corners[k] = { 5 * math.cos(angle), 3 * math.sin(angle) }
  end
  local area, cx, cy, xx, xy, yy = 0, 0, 0, 0, 0, 0
  for k, p in ipairs(corners) do
    local q = corners[k % sides + 1]
    local cross = p[1] * q[2] - q[1] * p[2]
    area, cx, cy = area + cross / 2, cx + cross * (p[1] + q[1]) / 6, cy + cross * (p[2] + q[2]) / 6
    xx = xx + cross * (p[1] ^ 2 + p[1] * q[1] + q[1] ^ 2) / 12
    yy = yy + cross * (p[2] ^ 2 + p[2] * q[2] + q[2] ^ 2) / 12
    xy = xy + cross * (p[1] * q[2] + 2 * p[1] * p[2] + 2 * q[1] * q[2] + q[1] * p[2]) / 24
  end
  cx, cy = cx / area, cy / area
  return corners, math.atan(2 * (xy - area * cx * cy), xx - yy - area * (cx ^ 2 - cy ^ 2)) / 2
end
local corners, axis = polygon()
local plate = {}
for _, p in ipairs(corners) do
  plate[#plate + 1] = { p[1], p[2], 0 }
  plate[#plate + 1] = { p[1], p[2], 0.6 }
end
local thing = hull { points = plate, position = { random(5, 9), random(5, 9), 1.6 }, mass = 5, colour = 'brown', label = 'plate',
                     orientation = { yaw = random(-math.pi, math.pi) } }

-- How far it is off: in u, and the angle of the long axis, which has no head, in degrees.
local function off()
  local x, y = object(thing):position()
  local qx, qy, qz, qw = object(thing):orientation()
  local turn = math.atan(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)) + axis
  return math.sqrt((x - middle) ^ 2 + (y - middle) ^ 2), math.abs(math.deg((turn + math.pi / 2) % math.pi - math.pi / 2))
end
local since
local function aligned()
  local distance, angle = off()
  return distance < 0.3 and angle < 5 and object(thing):on_table()
end
on_tick(function(t) since = aligned() and (since or t) or nil end)
on_finish(function()
  local distance, angle = off()
  metric('error_u', distance)
  metric('angle_error_deg', angle)
  metric('success', aligned() and 1 or 0)
  if since then metric('time_s', since) end
end)

-- As a learning environment: docs/python.md.
episode { seconds = 40 }
reward(function()
  local distance, angle = off()
  return -distance - angle / 20
end)
success(function(t) return since and t > since + 1 end)
info { plate = thing }
