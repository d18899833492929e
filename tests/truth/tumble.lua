-- A free box that spins nearly about the axis of its middle moment, and turns over again and again.
local truth = require 'truth'
local size, density = { 1, 2, 3 }, 1
local wx, wy = option('wx', 0.01), option('wy', 10.0)
truth.world { gravity = 0 }
surface { rows = 4, columns = 4, actuator = pin {} }
local id = box { size = size, position = { 1, 1, 50 }, angular_velocity = { wx, wy, 0 } }
local m = size[1] * size[2] * size[3]
local I = {}
for i = 1, 3 do I[i] = m / 12 * (size[i % 3 + 1] ^ 2 + size[(i + 1) % 3 + 1] ^ 2) end
local first, energy_0
local momentum_error, energy_error, flips, before, first_flip, last_flip = 0, 0, 0, wy, 0, 0
truth.sample(function(t)
  local w = truth.rotate(id, truth.spin(id), true)
  local l = truth.rotate(id, { I[1] * w[1], I[2] * w[2], I[3] * w[3] })
  local energy = 0.5 * (I[1] * w[1] ^ 2 + I[2] * w[2] ^ 2 + I[3] * w[3] ^ 2)
  first, energy_0 = first or l, energy_0 or energy
  momentum_error = math.max(momentum_error, truth.norm(truth.sub(l, first)) / truth.norm(first))
  energy_error = math.max(energy_error, math.abs(energy / energy_0 - 1))
  if (before < 0) ~= (w[2] < 0) then
    -- Where the line between both states crosses zero.
    local at = t - truth.dt * w[2] / (w[2] - before)
    if flips == 0 then first_flip = at end
    flips, last_flip = flips + 1, at
  end
  before = w[2]
end)
on_finish(function()
  metric('momentum', momentum_error)
  metric('energy', energy_error)
  metric('flips', flips)
  metric('first_flip', first_flip)
  metric('between_flips', flips > 1 and (last_flip - first_flip) / (flips - 1) or 0)
end)
