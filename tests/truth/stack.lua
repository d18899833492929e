-- A stack of boxes, the top one `ratio` times as heavy: stands, comes to rest, bears its weight.
local truth = require 'truth'
local n, ratio = option('n', 10), option('ratio', 1.0)
truth.world {}
material { name = 'default', friction = 0.5 }
surface { rows = 8, columns = 8, actuator = pin {}, sensors = { pressure {} } }
local ids = {}
for i = 1, n do
  ids[i] = box { size = { 2, 2, 1 }, mass = i == n and ratio or 1, position = { 3.5, 3.5, i - 0.5 } }
end
local load, ticks, squares, drift = 0, 0, 0, 0
truth.sample(function(t)
  if t < 4 then return end
  ticks, load = ticks + 1, load + truth.load()
  for _, id in ipairs(ids) do squares = squares + truth.norm(truth.velocity(id)) ^ 2 end
end)
on_finish(function()
  for i, id in ipairs(ids) do
    local p = truth.position(id)
    drift = math.max(drift, math.sqrt((p[1] - 3.5) ^ 2 + (p[2] - 3.5) ^ 2))
  end
  metric('height', truth.position(ids[n])[3] + 0.5)
  metric('drift', drift)
  metric('buzz', math.sqrt(squares / (ticks * n)))
  metric('load', load / ticks)
end)
