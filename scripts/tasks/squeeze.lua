-- A rod anywhere, turned anyhow, on a force field: where and how does it lie in the end?
material { name = 'slippery', friction = 0.05 }
surface { rows = 24, columns = 24, material = 'slippery', actuator = force_field { max_force = 4, reach = 1 },
          sensors = { proximity { range = 4 } } }
local rod = box { size = {7, 1.6, 1}, position = { random(6, 17), random(6, 17), 0.55 },
                  orientation = { yaw = random(0, math.pi) }, colour = 'purple', material = 'slippery' }

local function errors()
  local x, y = object(rod):position()
  local _, _, qz, qw = object(rod):orientation()
  local turned = (2 * math.atan(qz, qw)) % math.pi - math.pi / 2
  return math.abs(math.deg(turned)), math.sqrt((x - 11.5)^2 + (y - 11.5)^2)
end
local function lies()
  local angle_error, error_u = errors()
  return angle_error < 5 and error_u < 0.5 and object(rod):on_table()
end
on_finish(function()
  local angle_error, error_u = errors()
  metric('success', lies() and 1 or 0)
  metric('angle_error_deg', angle_error)
  metric('error_u', error_u)
end)

-- As a learning environment: docs/python.md.
episode { seconds = 30 }
reward(function()
  local angle_error, error_u = errors()
  return -error_u - angle_error / 45
end)
success(lies)
info { rod = rod }
