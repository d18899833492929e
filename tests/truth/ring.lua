-- Eighteen mixed objects inside a ring of pins that rise and fall at 4 u/s, all together or every other one.
local truth = require 'truth'
truth.world { seed = 1 }
record { objects = true, every = truth.rate // 60 }
surface { rows = 14, columns = 14, actuator = pin { max_speed = 4 }, border = { height = 6 } }
material { name = 'default', friction = 0.5 }
local middle, shapes = 6.5, {
  function(at) sphere { radius = random(0.5, 1), position = at } end,
  function(at, turned)
    box { size = { random(0.8, 2.2), random(0.8, 2.2), random(0.6, 1.8) }, position = at, orientation = turned }
  end,
  function(at, turned)
    cylinder { radius = random(0.5, 1), height = random(0.6, 2), position = at, orientation = turned }
  end,
  function(at, turned)
    capsule { radius = random(0.4, 0.7), height = random(1.6, 2.4), position = at, orientation = turned }
  end,
  function(at, turned) box { size = { random(1.5, 2.4), 0.5, 0.5 }, position = at, orientation = turned } end,
  function(at, turned)
    cone { radius = random(0.6, 1), height = random(0.8, 1.8), position = at, orientation = turned }
  end,
}
for i = 0, 17 do
  local angle, radius = 2.4 * i, 3 * math.sqrt((i % 6 + 0.5) / 6)
  shapes[i % 6 + 1]({ middle + radius * math.cos(angle), middle + radius * math.sin(angle), 1.6 + 2.4 * (i // 6) },
    { axis = { 0, 0, 1 }, angle = random(0, 3) })
end
local inner, checkered = random(1.5, 3), random(0, 1) < 0.5
every(0.7, function(t)
  local up = math.floor(t / 0.7 + 0.5) % 2 == 1
  for r = 2, 13 do
    for c = 2, 13 do
      local distance = math.sqrt((c - 1 - middle) ^ 2 + (14 - r - middle) ^ 2)
      if distance >= inner and distance <= inner + 2.2 then
        local rises = up ~= (checkered and (r + c) % 2 == 1)
        cells:target('height', r, c, rises and 3 or 0)
      end
    end
  end
end)
