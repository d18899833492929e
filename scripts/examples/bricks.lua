-- Round towers, laid brick by brick by the script, and then shot at.
-- Run it with: smartsurf run scripts/examples/bricks.lua --no-controller --window
local courses = option('courses', 14, 'layers of bricks in a tower', { 1, 100 })
local bricks = option('bricks', 24, 'bricks in a layer', { 3, 200 })
local towers = option('towers', 3, 'along each side of the square of towers', { 1, 20 })
local shot_at = option('shot_at', 2, 'when the balls come, s')
local seconds = option('seconds', 6, 'how long the run lasts, s')

local length, width, height = 1.6, 0.9, 0.8
local radius = bricks * (length + 0.12) / (2 * math.pi)
local spacing = 2 * radius + 6
local side = math.ceil(towers * spacing + 8)

world { seed = 1 }
material { name = 'brick', friction = 0.7, restitution = 0, density = 1 }
material { name = 'iron', friction = 0.4, restitution = 0, density = 5 }

surface { rows = side, columns = side, actuator = pin { range = { 0, 6 } }, border = { height = 6 }, material = 'brick' }

local middle = (side - 1) / 2
local function place(i) return middle + (i - (towers + 1) / 2) * spacing end

local colours = { '#b2432f', '#c8643c', '#a33a2a', '#bd5540' }
for i = 1, towers do
  for j = 1, towers do
    for course = 1, courses do
      for brick = 1, bricks do
        local angle = 2 * math.pi * (brick + 0.5 * (course % 2)) / bricks
        box { size = { width, length, height }, material = 'brick', label = 'brick',
              colour = colours[1 + (brick * 7 + course * 3) % #colours],
              position = { place(i) + radius * math.cos(angle), place(j) + radius * math.sin(angle), (course - 0.5) * height },
              orientation = { yaw = angle } }
      end
    end
  end
end

at(shot_at, function()
  for i = 1, towers do
    for j = 1, towers do
      if (i + j) % 2 == 0 then
        sphere { radius = 1.6, position = { place(i) - radius - 4, place(j), courses * height + 1 }, velocity = { 30, 4, 2 },
                 material = 'iron', colour = '#303840', label = 'ball' }
      end
    end
  end
end)

at(seconds, stop)
