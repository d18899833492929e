-- Rain: objects of several shapes keep falling at random places.
-- Run it with: smartsurf run scripts/examples/rain.lua --no-controller --window --set count=500
world { seed = 1 }

surface { rows = 32, columns = 32, sensors = { proximity { range = 8 } }, border = { height = 6 } }

local count = option('count', 200, 'number of objects that fall', { 1, 100000 })
local rate = option('rate', 20.0, 'objects a second', { 0.01, 1000 })
local colours = { 'red', 'orange', 'yellow', 'green', 'blue', 'purple' }

local fallen = 0
every(1 / rate, function()
  if fallen == count then return false end -- no more calls
  fallen = fallen + 1
  local common = { position = { random(4, 27), random(4, 27), random(12, 16) },
                   colour = colours[math.random(#colours)], velocity = { 0, 0, -5 } }
  local kind = math.random(3)
  if kind == 1 then
    common.radius = random(0.8, 1.6)
    sphere(common)
  elseif kind == 2 then
    common.size = { random(1, 2), random(1, 2), random(1, 2) }
    common.orientation = { roll = random(0, 3), pitch = random(0, 3), yaw = random(0, 3) }
    box(common)
  else
    common.radius, common.height = random(0.6, 1.2), random(1, 2)
    cylinder(common)
  end
end)

at(count / rate + 5, stop)
