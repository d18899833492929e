-- Free fall: spheres, boxes and a cylinder drop on a level surface, beside a closed form.
-- Run it with: smartsurf run scripts/examples/drop.lua --no-controller --window
world { gravity = -9.81, control_period = 1/60, seed = 1 }

material { name = 'rubber', friction = 0.9, restitution = 0.7, density = 1.1 }
material { name = 'wood', friction = 0.4, restitution = 0.2, density = 0.6 }

surface { rows = 24, columns = 24, pitch = 1.0,
          actuator = pin { top = 0.8, range = { 0, 6 } },
          sensors = { proximity { range = 8 } },
          border = { height = 4 } }

local height = option('height', 20.0, 'how high the objects start, u', { 2, 10000 })
local seconds = option('seconds', 5, 'how long the run lasts, s')

local ball = sphere { radius = 1, position = { 6, 6, height }, material = 'rubber', colour = 'red', label = 'ball' }
for i = 0, 2 do
  box { size = { 2, 2, 2 }, position = { 14, 14, height + 3 * i }, material = 'wood', colour = 'orange',
        orientation = { axis = { 0, 0, 1 }, angle = random(0, math.pi / 2) }, label = 'box' }
end
cylinder { radius = 1, height = 2, position = { 6, 15, height }, material = 'wood', colour = 'blue', label = 'drum' }

-- Until it lands, the ball's centre is at height - g t² / 2, but for the error of the finite step, g t dt / 2.
local landing = math.sqrt(2 * (height - 1) / 9.81)
at(0.9 * landing, function(t)
  local _, _, z = object(ball):position()
  print(string.format('t = %.3f s: the ball is at z = %.3f, free fall says %.3f', t, z, height - 9.81 * t * t / 2))
end)

at(seconds, stop)
