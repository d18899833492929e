-- A box on 16×16 rolling balls is to lie in the middle, along the rows, from anywhere and however it is turned.
local near, aligned = 0.5, math.rad(10)

surface { rows = 16, columns = 16, border = { height = 3 }, actuator = ball { radius = 0.4, max_spin = 20 },
          sensors = { proximity { range = 4 } } }
local box_id = box { size = { 5, 2.5, 1 }, position = { random(4, 11), random(4, 11), 0.6 },
                     orientation = { yaw = random(-math.pi, math.pi) }, colour = 'orange' }

-- Distance from the middle in u, and the angle to the rows, 0 … π/2: the box looks alike from both ends.
local function pose()
  local x, y = object(box_id):position()
  local qx, qy, qz, qw = object(box_id):orientation()
  local yaw = math.atan(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)) % math.pi
  return math.sqrt((x - 7.5)^2 + (y - 7.5)^2), math.min(yaw, math.pi - yaw)
end

local function cost()
  local distance, angle = pose()
  return distance + 3 * angle
end
local sum, ticks = 0, 0
on_tick(function() sum, ticks = sum + cost(), ticks + 1 end)
episode { seconds = 10 }
reward(function() return -cost() end)
on_finish(function()
  local distance, angle = pose()
  metric('error_u', distance)
  metric('angle_deg', math.deg(angle))
  metric('success', distance < near and angle < aligned and 1 or 0)
  metric('score', -sum / ticks)
end)
