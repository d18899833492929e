-- What all cases share: the step, gravity, sampling. A tick is one physics step.
local truth = { g = 9.81 }
truth.rate = option('rate', 240, 'physics steps per second')
truth.dt = 1 / truth.rate

function truth.world(fields)
  fields.dt, fields.control_period = truth.dt, truth.dt
  world(fields)
end

-- Gravity of a table that slopes by `angle` (degrees) down to the east.
function truth.slope(angle, g)
  g = g or truth.g
  return { g * math.sin(math.rad(angle)), 0, -g * math.cos(math.rad(angle)) }
end

-- Calls f(t) with every state, the first and the last included. Declare it before the on_finish that uses its results.
function truth.sample(f)
  on_tick(function(t) f(t) end)
  on_finish(function(t) f(t + truth.dt) end)
end

-- Follows a value that swings: its mean period, and the natural logarithm of the ratio of one swing to that a period later.
function truth.swing(value)
  local extremes, last, before = {}, nil, nil
  truth.sample(function(t)
    local z = value()
    if before and (last.z - before.z) * (z - last.z) < 0 then
      -- The vertex of the parabola through three states.
      local a, b = (z - 2 * last.z + before.z) / 2, (z - before.z) / 2
      extremes[#extremes + 1] = { t = last.t - b / (2 * a) * truth.dt, z = last.z - b * b / (4 * a) }
    end
    before, last = last, { t = t, z = z }
  end)
  local function size(i) return math.abs(extremes[i + 1].z - extremes[i].z) end
  local swing = {}
  function swing.period() return 2 * (extremes[#extremes].t - extremes[1].t) / (#extremes - 1) end
  function swing.decrement() return 2 * math.log(size(1) / size(#extremes - 1)) / (#extremes - 2) end
  return swing
end

-- The state of an object as vectors.
function truth.position(id) return { object(id):position() } end
function truth.velocity(id) return { object(id):velocity() } end
function truth.spin(id) return { object(id):angular_velocity() } end

function truth.norm(v) return math.sqrt(v[1] ^ 2 + v[2] ^ 2 + v[3] ^ 2) end
function truth.sub(a, b) return { a[1] - b[1], a[2] - b[2], a[3] - b[3] } end
function truth.dot(a, b) return a[1] * b[1] + a[2] * b[2] + a[3] * b[3] end
function truth.cross(a, b)
  return { a[2] * b[3] - a[3] * b[2], a[3] * b[1] - a[1] * b[3], a[1] * b[2] - a[2] * b[1] }
end
-- Rotates v by the quaternion of the object, or back.
function truth.rotate(id, v, back)
  local x, y, z, w = object(id):orientation()
  local u = back and { -x, -y, -z } or { x, y, z }
  local a = truth.cross(u, v)
  local b = truth.cross(u, a)
  return { v[1] + 2 * (w * a[1] + b[1]), v[2] + 2 * (w * a[2] + b[2]), v[3] + 2 * (w * a[3] + b[3]) }
end

-- Sum of the readings of `pressure` over all cells.
function truth.load()
  local sum = 0
  for r = 1, cells.rows do
    for c = 1, cells.columns do sum = sum + cells:truth('pressure', r, c) end
  end
  return sum
end

return truth
