-- Mechanisms from robot descriptions: a URDF pendulum, a URDF drawer that a finger pulls out, and an MJCF hammer on its stand.
-- Run with --no-controller.
world { unit = 'cm' }
surface { rows = 24, columns = 24, pitch = 4, actuator = pin { top = 3.6, range = { 0, 8 }, max_speed = 80, max_acceleration = 1600 } }

local pendulum = urdf { file = 'models/pendulum.urdf', position = { 70, 70, 10 } }
local drawer = urdf { file = 'models/drawer.urdf', position = { 30, 70, 0 }, fixed = true }
local toy = mjcf { file = 'models/hammer.xml', position = { 46, 30, 0 } }

-- The period of small swings from what the file says: rod and bob together about the bearing, in metres and kilograms.
local inertia = 0.01 + 0.5 * 0.3 ^ 2 + 0.0001 + 0.2 * 0.4 ^ 2
local expected = 2 * math.pi * math.sqrt(inertia / ((0.5 * 0.3 + 0.2 * 0.4) * 9.81))

local passages, before = {}, nil
at(0, function() object(pendulum.objects.rod):push { force = { 20, 0, 0 } } end)
on_tick(function(t)
  local angle = joint(pendulum.joints.bearing):coordinate()
  if before and before < 0 and angle >= 0 then
    passages[#passages + 1] = t - angle / (angle - before) / 60
  end
  before = angle
  if t < 0.5 then object(drawer.objects.tray):push { force = { 400, 0, 0 } } end
end)
on_finish(function()
  local period = (passages[#passages] - passages[1]) / (#passages - 1)
  print(('period %.4f s, expected %.4f s'):format(period, expected))
  print(('the drawer is open by %.2f cm'):format(joint(drawer.joints.rail):coordinate()))
  print(('the hammer hangs %.2f degrees below its spring\'s rest'):format(math.deg(joint(toy.joints.hinge):coordinate())))
end)
