-- A chain of slender rods, hinged about the north axis, falls from a start in which the first lies to the east and the
-- others stand: its energy, and how much it spins out of its plane.
local truth = require 'truth'
local n, h = option('n', 2), option('h', 0.1)
truth.world {}
surface { rows = 4, columns = 4, actuator = pin {} }
local rods, x, z = {}, 50, 50
for i = 1, n do
  local lying = i == 1
  rods[i] = box { size = lying and { 1, h, h } or { h, h, 1 }, mass = 1,
                  position = lying and { x + 0.5, 0, z } or { x, 0, z + 0.5 } }
  joint { kind = 'hinge', a = rods[i], b = rods[i - 1], anchor = { x, 0, z }, axis = { 0, 1, 0 } }
  if lying then x = x + 1 else z = z + 1 end
end
-- Moments of inertia: along a rod, and across it; the rods are square.
local along, across = h * h / 6, (1 + h * h) / 12
local function energy()
  local sum = 0
  for i, id in ipairs(rods) do
    local v, w = truth.velocity(id), truth.rotate(id, truth.spin(id), true)
    local axis = i == 1 and 1 or 3
    local own = w[axis] ^ 2
    sum = sum + truth.dot(v, v) / 2 + truth.g * truth.position(id)[3]
          + (along * own + across * (truth.dot(w, w) - own)) / 2
  end
  return sum
end
local first, worst, out = nil, 0, 0
truth.sample(function()
  first = first or energy()
  worst = math.max(worst, math.abs(energy() - first))
  for _, id in ipairs(rods) do
    local w = truth.spin(id)
    out = math.max(out, math.abs(w[1]), math.abs(w[3]))
  end
end)
on_finish(function()
  metric('energy', worst / (n * truth.g))
  metric('out', out)
end)
