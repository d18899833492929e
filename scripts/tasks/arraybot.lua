-- What the tasks arraybot_lift, arraybot_flip and arraybot_relocate share: an array of 16×16 pillars like ArrayBot's (arXiv
-- 2306.16857), 16 mm wide with 1 mm gaps and 55 mm of travel, which feel loads alone, with faults; and a generator of objects.
-- The seed determines object, place and faulty pillars.
local M = { pitch = 1.7, travel = 5.5, middle = 7.5 * 1.7 }

-- Declares world, materials, surface and faults. sensors: further ones.
function M.surface(arguments)
  local faulty = option('faulty', 0.02, 'share of the pillars without touch; of those that are weak; half of it: dead, stuck', { 0, 0.5 })
  local noise = option('noise', 0.5, 'standard deviation of a load, kg·cm/s²; an object weighs about 40')
  world { unit = 'cm', control_period = 0.1, seed = option('seed', 1, 'of object, place and faults') }
  material { name = 'plastic', friction = 0.5, restitution = 0, density = 5e-4 }
  surface { rows = 16, columns = 16, pitch = M.pitch, material = 'plastic',
            actuator = pin { top = 1.6, range = { 0, M.travel }, max_speed = 8, max_acceleration = 200 },
            sensors = { pressure { range = 500, noise = noise, dropout = noise > 0 and 0.01 or 0, dead = faulty },
                        table.unpack(arguments.sensors or {}) } }
  faults { actuator = { dead = faulty / 2, stuck = faulty / 2, weak = { fraction = faulty, gain = 0.7 } } }
end

-- Points near the surface of an ellipsoid at that place, of which a part of an object is the convex hull.
local function blob(count, centre, axes)
  local points = {}
  for k = 1, count do
    -- Evenly spread over the sphere (a Fibonacci lattice), then moved at random.
    local z, turn = 1 - (2 * k - 1) / count, 2.399963 * k
    local r, stretch = math.sqrt(1 - z * z), random(0.75, 1)
    points[k] = { centre[1] + axes[1] * stretch * (r * math.cos(turn) + random(-0.15, 0.15)),
                  centre[2] + axes[2] * stretch * (r * math.sin(turn) + random(-0.15, 0.15)),
                  centre[3] + axes[3] * stretch * (z + random(-0.15, 0.15)) }
  end
  return points
end

-- The parts of an object whose bounding box has these edges. Complexity 1 to 3: one convex part of 8, 12, 16 points. 4 to 8: a
-- concave union of 2 to 6 parts, each attached to an earlier one on a random side.
function M.parts(complexity, edges)
  local parts, centres = {}, { { 0, 0, 0 } }
  if complexity <= 3 then
    parts[1] = blob(4 + 4 * complexity, centres[1], { 1, 1, 1 })
  else
    parts[1] = blob(10, centres[1], { 1, 1, 1 })
    for k = 2, complexity - 2 do
      local from, direction = centres[math.random(#centres)], { random(-1, 1), random(-1, 1), random(-0.5, 0.5) }
      local length = math.sqrt(direction[1] ^ 2 + direction[2] ^ 2 + direction[3] ^ 2)
      centres[k] = {}
      for i = 1, 3 do centres[k][i] = from[i] + 0.95 * direction[i] / length end
      parts[k] = blob(10, centres[k], { random(0.7, 1), random(0.7, 1), random(0.7, 1) })
    end
  end
  for i = 1, 3 do
    local low, high = math.huge, -math.huge
    for _, part in ipairs(parts) do
      for _, p in ipairs(part) do low, high = math.min(low, p[i]), math.max(high, p[i]) end
    end
    for _, part in ipairs(parts) do
      for _, p in ipairs(part) do p[i] = (p[i] - low) / (high - low) * edges[i] end
    end
  end
  return parts
end

-- Declares an object above the pillars at x, y, turned at random about the vertical, and returns its id.
function M.object(x, y, edges)
  local complexity = option('complexity', 0, 'of the object, 1 to 8; 0: drawn')
  if complexity < 0 or complexity > 8 then error('option complexity = ' .. complexity .. ': must be 0 to 8') end
  if complexity == 0 then complexity = math.random(8) end
  metric('complexity', complexity)
  return hull { parts = M.parts(complexity, edges), position = { x, y, edges[3] / 2 + 1 }, material = 'plastic', colour = 'orange',
                orientation = { yaw = random(-math.pi, math.pi) }, label = 'object' }
end

-- The world's vertical in the object's own axes.
function M.upright(id)
  local x, y, z, w = object(id):orientation()
  return { 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y) }
end

-- The angle between what was the world's vertical in the object's own axes and what is now, in degrees.
function M.turned(id, before)
  local now, dot = M.upright(id), 0
  for i = 1, 3 do dot = dot + now[i] * before[i] end
  return math.deg(math.acos(math.max(-1, math.min(dot, 1))))
end

-- The least and the greatest of the values that were added in the last second; nothing before the first.
function M.last_second()
  local values, place = {}, 1
  return {
    add = function(value) values[place], place = value, place % 10 + 1 end,
    least = function() return math.min(table.unpack(values)) end,
    greatest = function() return math.max(table.unpack(values)) end,
  }
end

-- A random point of the table, at least so many pillars from its edge.
function M.place(from_edge)
  return random(from_edge, 15 - from_edge) * M.pitch, random(from_edge, 15 - from_edge) * M.pitch
end

return M
