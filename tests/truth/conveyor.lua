-- A box, or a disc, on belts: it crosses a seam, is fed from aside, is centred, straddles two belts, or turns on a disc.
-- Its centre of mass is at its underside, so that friction does not shift the load; the tops leave no gaps.
local truth = require 'truth'
local kind = option('kind', 'transfer')
local v1, v2, mu = option('v1', 1.0), option('v2', 3.0), option('mu', 0.5)
local length, width = option('length', 4.0), option('width', 3.0)
local offset, angle = option('offset', 0.5), option('angle', 30.0)
truth.world {}
material { name = 'default', friction = mu, rolling_friction = 0, restitution = 0 }
local rows, columns = kind == 'turntable' and 24 or 16, kind == 'turntable' and 24 or 64
surface { rows = rows, columns = columns, actuator = conveyor { top = 1, max_speed = 100, max_acceleration = 1e6,
                                                                max_turn = 100, max_turn_acceleration = 1e6 } }
local function belts(drive)
  for row = 1, rows do
    for column = 1, columns do
      local x, y, turn = drive(cells:centre(row, column))
      cells:target('drive_x', row, column, x)
      cells:target('drive_y', row, column, y)
      cells:target('turn', row, column, turn or 0)
    end
  end
end
local height = 0.4
local function plate(x, y, velocity, spin)
  local fields = { position = { x, y, height / 2 }, velocity = velocity, angular_velocity = spin, com = { 0, 0, -height / 2 } }
  if kind == 'straddle_disc' then
    fields.radius, fields.height = width / 2, height
    return cylinder(fields)
  end
  fields.size = { length, width, height }
  return box(fields)
end
local rad, id, on_start, on_state = math.rad(angle), nil, nil, function() end
truth.sample(function(t) on_state(t) end)

if kind == 'transfer' then      -- from a belt at v1 to one at v2, whose seam is at x = 19.5
  local seam = 19.5
  id = plate(seam - length / 2 - 0.5, 7, { v1, 0, 0 })
  on_start = function() belts(function(x) return x < seam and v1 or v2, 0 end) end
  on_finish(function(t)
    -- The first belt holds it until half of it is over the seam; from then on it slips.
    local begin = (length / 2 + 0.5) / v1
    metric('ahead', truth.position(id)[1] - seam - v2 * (t + truth.dt - begin))
    metric('v', truth.velocity(id)[1])
  end)
elseif kind == 'feed' then      -- fed at v1 under an angle onto a belt at v2: it slips along a line
  id = plate(10, 7, { v1 * math.cos(rad), v1 * math.sin(rad), 0 })
  on_start = function() belts(function() return v2, 0 end) end
  on_finish(function(t)
    local p = truth.position(id)
    metric('aside', p[2] - 7)
    metric('ahead', p[1] - 10 - v2 * (t + truth.dt))
    metric('spin', truth.spin(id)[3])
  end)
elseif kind == 'centre' then    -- two belts drive it against each other and on at v1: it swings across the seam at y = 7.5
  id = plate(6, 7.5 + offset, { v1, 0, 0 })
  on_start = function() belts(function(_, y) return v1, y > 7.5 and -v2 or v2 end) end
  local before, first, last, crossings = offset, nil, nil, 0
  on_state = function(t)
    local y = truth.position(id)[2] - 7.5
    if (before < 0) ~= (y < 0) then
      last = t - truth.dt * y / (y - before)
      first, crossings = first or last, crossings + 1
    end
    before = y
  end
  on_finish(function(t)
    metric('period', 2 * (last - first) / (crossings - 1))
    metric('ahead', truth.position(id)[1] - 6 - v1 * (t + truth.dt))
  end)
elseif kind == 'straddle' or kind == 'straddle_disc' then    -- half on a belt at v1, half on one at -v1: it begins to turn
  id = plate(30, 7.5)
  on_start = function() belts(function(_, y) return y > 7.5 and -v1 or v1, 0 end) end
  on_finish(function(t) metric('rate', truth.spin(id)[3] / (t + truth.dt)) end)
elseif kind == 'turntable' then    -- rides on a disc that turns at v2, `offset` from its middle
  local x = offset * math.cos(rad)
  local y = offset * math.sin(rad)
  id = plate(11.5 + x, 11.5 + y, { -v2 * y, v2 * x, 0 }, { 0, 0, v2 })
  on_start = function() belts(function(cx, cy) return -v2 * (cy - 11.5), v2 * (cx - 11.5), v2 end) end
  local turned, last = 0, math.atan(y, x)
  on_state = function()
    local p = truth.position(id)
    local now = math.atan(p[2] - 11.5, p[1] - 11.5)
    turned, last = turned + (now - last + math.pi) % (2 * math.pi) - math.pi, now
  end
  on_finish(function()
    local p = truth.position(id)
    metric('turned', turned)
    metric('radius', math.sqrt((p[1] - 11.5) ^ 2 + (p[2] - 11.5) ^ 2))
    metric('spin', truth.spin(id)[3])
  end)
end
at(0, on_start)
