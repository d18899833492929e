-- Movers are levitated over a table of coils and carry goods from tile to tile: the ten layouts of MagBotSim's benchmarks of
-- trajectory planning. Strategy: all movers step from tile to tile at the same time; who waits longest for its goal steps
-- first, and whoever is in its way gives way (PIBT: Okumura and others, Artificial Intelligence 310, 2022). The currents
-- of the coils below a mover are the least that give the force by which it follows a smooth path.
local logistics = require 'logistics'
local layout, count = option('layout', 0, 'of MagBotSim', { 0, 9 }), option('goals', 4, 'of each mover', { 1, 1000 })
local layouts = {
  [0] = { 3, '111 111 111 111' }, { 3, '111 111 011 111' }, { 4, '11111 11111 00011 11111 11111 11000 11111 11111' },
  { 4, '0011100 0011100 1111111 1110111 1111111 0011100 0011100' },
  { 4, '111111 111111 111111 100011 110001 111111 111111 111111' },
  { 3, '111111 111111 111111 001100 001100 001100 001100 001100 111111 111111 111111' },
  { 4, '000111 000111 000111 111111 111111 111000 111000 111000' },
  { 4, '1110111 1110111 1100011 1100011 1100011 1111111 1111111' },
  { 5, '111111 111111 111100 111100 111111 101111 001111 000100' },
  { 5, '11111000 11111100 00111110 00111111 10011011 11111011 11111111 11111110' } }
local movers, map = layouts[layout][1], {}
for line in layouts[layout][2]:gmatch('%S+') do map[#map + 1] = line end

local coils, pitch, side, thick, hover = 6, 4, 15.5, 1.2, 2.0     -- of a tile's edge; cm
local tile, step_s, radius = coils * pitch, 0.6, 7.0
world { unit = 'cm', dt = 1 / 240, control_period = 1 / 240, sleep = false }
material { name = 'default', friction = 0.3, restitution = 0.1 }
surface { pitch = pitch, actuator = magnet { top = 3.6, law = 'pole', strength = 1e5, depth = 1, reach = radius, max_current = 2 },
          modules = { size = { coils, coils }, map = (function()
            local rows = {}
            for i, line in ipairs(map) do rows[i] = line:gsub('1', '#'):gsub('0', '.') end
            return rows
          end)() } }

-- Tiles are numbered row by row; `middle` is where a mover rests on one.
local width, height = #map[1], #map
local function is_tile(k) local r, c = k // width, k % width; return r >= 0 and r < height and map[r + 1]:sub(c + 1, c + 1) == '1' end
local function middle(k) return (k % width * coils + (coils - 1) / 2) * pitch, ((height - 1 - k // width) * coils + (coils - 1) / 2) * pitch end
local function neighbours(k)
  local near, c = {}, k % width
  for _, n in ipairs { c > 0 and k - 1 or -1, c < width - 1 and k + 1 or -1, k - width, k + width } do
    if n >= 0 and n < width * height and is_tile(n) then near[#near + 1] = n end
  end
  return near
end
local tiles = {}
for k = 0, width * height - 1 do if is_tile(k) then tiles[#tiles + 1] = k end end

-- Steps from each tile to a goal.
local steps_to = {}
local function steps(goal)
  if steps_to[goal] then return steps_to[goal] end
  local from, queue, head = { [goal] = 0 }, { goal }, 1
  while queue[head] do
    for _, n in ipairs(neighbours(queue[head])) do
      if not from[n] then from[n], queue[#queue + 1] = from[queue[head]] + 1, n end
    end
    head = head + 1
  end
  steps_to[goal] = from
  return from
end

local meter, all, free = logistics.new(0.5, 0.01), {}, { table.unpack(tiles) }
for i = 1, movers do
  local at_tile = table.remove(free, math.floor(random(1, #free + 1)))
  local x, y = middle(at_tile)
  all[i] = { at = at_tile, next = at_tile, waits = 0, reached = 0,
             id = box { size = { side, side, thick }, position = { x, y, hover + thick / 2 }, mass = 1, pole = 1, label = 'mover' } }
end
local function new_goal(mover)
  repeat mover.goal = tiles[math.floor(random(1, #tiles + 1))] until mover.goal ~= mover.next
  meter.aim(mover.id, middle(mover.goal))
end

-- PIBT: finds the next tile of a mover; those in its way find theirs first. Squares that turn a corner behind each other
-- touch, so a mover enters a tile only with one that leaves it straight on, and waits a step otherwise.
local taken, planned
local function occupant(k, mover)
  for _, m in ipairs(all) do if m ~= mover and m.at == k then return m end end
end
local function plan(mover, pusher)
  local from, choices = steps(mover.goal), neighbours(mover.at)
  choices[#choices + 1] = mover.at
  for i, k in ipairs(choices) do choices[i] = { k, from[k] + 0.5 * random() } end
  table.sort(choices, function(a, b) return a[2] < b[2] end)
  for _, choice in ipairs(choices) do
    local k = choice[1]
    if not taken[k] and not (pusher and k == pusher.at) then
      taken[k], planned[mover], mover.next = mover, true, k
      local other = occupant(k, mover)
      if not other or planned[other] or plan(other, mover) then
        if not other or other.next - other.at == k - mover.at then return true end
        local is_free = not taken[mover.at]
        taken[mover.at], mover.next = mover, mover.at
        return is_free
      end
    end
  end
  taken[mover.at], planned[mover], mover.next = mover, true, mover.at
  return false
end

-- The coils near a mover, and the currents of least square with that force: Aᵀ(AAᵀ)⁻¹F, by Cramer's rule.
local function drive(x, y, z, fx, fy, fz, currents)
  local near, m = {}, { 0, 0, 0, 0, 0, 0 }     -- xx, yy, zz, xy, xz, yz
  local r0, c0 = cells.rows - math.floor(y / pitch + 0.5), math.floor(x / pitch + 0.5) + 1
  for r = math.max(1, r0 - 2), math.min(cells.rows, r0 + 2) do
    for c = math.max(1, c0 - 2), math.min(cells.columns, c0 + 2) do
      local dx, dy, dz = x - (c - 1) * pitch, y - (cells.rows - r) * pitch, z + 1     -- from the coil, 1 cm below the top
      local d2 = dx * dx + dy * dy + dz * dz
      if d2 < radius ^ 2 and map[(r - 1) // coils + 1]:sub((c - 1) // coils + 1, (c - 1) // coils + 1) == '1' then
        local f = 1e5 / (d2 * math.sqrt(d2))
        local a, b, e = f * dx, f * dy, f * dz
        near[#near + 1] = { (r - 1) * cells.columns + c, a, b, e }
        m[1], m[2], m[3] = m[1] + a * a, m[2] + b * b, m[3] + e * e
        m[4], m[5], m[6] = m[4] + a * b, m[5] + a * e, m[6] + b * e
      end
    end
  end
  local xx, yy, zz, xy, xz, yz = table.unpack(m)
  local ix, iy, iz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
  local det = xx * ix + xy * iy + xz * iz
  if math.abs(det) < 1 then return end
  local lx = (ix * fx + iy * fy + iz * fz) / det
  local ly = (iy * fx + (xx * zz - xz * xz) * fy + (xy * xz - xx * yz) * fz) / det
  local lz = (iz * fx + (xy * xz - xx * yz) * fy + (xx * yy - xy * xy) * fz) / det
  for _, coil in ipairs(near) do currents[coil[1]] = currents[coil[1]] + coil[2] * lx + coil[3] * ly + coil[4] * lz end
end

local began, done_at, least_gap = -math.huge, nil, math.huge
on_tick(function(t, tick)
  if tick == 0 then for _, mover in ipairs(all) do new_goal(mover) end end
  meter.update(t)
  if t >= began + step_s - 1e-9 then     -- all have arrived at a tile
    for _, mover in ipairs(all) do
      mover.at, mover.waits = mover.next, mover.reached < count and mover.waits + 1 or -1
      if mover.at == mover.goal and mover.reached < count and meter.distance(mover.id) < 0.5 then
        mover.reached, mover.waits = mover.reached + 1, 0
        meter.reached(mover.id, t)
        new_goal(mover)
      end
    end
    began, taken, planned = t, {}, {}
    local order = { table.unpack(all) }
    table.sort(order, function(a, b) return a.waits > b.waits or (a.waits == b.waits and a.id < b.id) end)
    for _, mover in ipairs(order) do if not planned[mover] then plan(mover) end end
  end
  local currents, left = {}, false
  for k = 1, cells.rows * cells.columns do currents[k] = 0 end
  local s = (t - began) / step_s
  -- The smooth step from 0 to 1 whose jerk is least, and its derivatives.
  local w = s ^ 3 * (10 - 15 * s + 6 * s * s)
  local w1, w2 = 30 * s * s * (1 - s) ^ 2 / step_s, 60 * s * (1 - s) * (1 - 2 * s) / step_s ^ 2
  for _, mover in ipairs(all) do
    local o = object(mover.id)
    local x, y, z = o:position()
    local vx, vy, vz = o:velocity()
    local x0, y0 = middle(mover.at)
    local x1, y1 = middle(mover.next)
    local kp, kd = 400, 36
    drive(x, y, z, (x1 - x0) * w2 + kp * (x0 + (x1 - x0) * w - x) + kd * ((x1 - x0) * w1 - vx),
          (y1 - y0) * w2 + kp * (y0 + (y1 - y0) * w - y) + kd * ((y1 - y0) * w1 - vy),
          981 + kp * (hover + thick / 2 - z) - kd * vz, currents)
    least_gap = math.min(least_gap, z - thick / 2)
    left = left or mover.reached < count
  end
  cells:targets('current', currents)
  for i = 1, #all do
    local xi, yi = object(all[i].id):position()
    for j = i + 1, #all do
      local xj, yj = object(all[j].id):position()
      meter.pair(all[i].id, all[j].id, math.max(math.abs(xi - xj), math.abs(yi - yj)) - side)
    end
  end
  if not left and not done_at then
    done_at = t
    stop(string.format('all goals reached after %.1f s', t), meter.sums.collisions == 0 and least_gap > 0)
  end
end)
episode { seconds = 120 }
success(function() return done_at and meter.sums.collisions == 0 and least_gap > 0 end)
on_finish(function()
  meter.report()
  metric('least_gap_cm', least_gap)
  metric('success', done_at and meter.sums.collisions == 0 and least_gap > 0 and 1 or 0)
end)
