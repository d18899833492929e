-- A cone spins on its tip, which friction holds. It starts in steady precession.
local truth = require 'truth'
local spin, tilt = option('spin', 60.0), math.rad(option('tilt', 20.0))
local radius, height = 1, 1
local l = 0.75 * height
local I3 = 0.3 * radius ^ 2
local I1 = 0.15 * radius ^ 2 + 0.0375 * height ^ 2 + l ^ 2
local a, b, c = I1 * math.cos(tilt), I3 * spin, truth.g * l
local rate = (b - math.sqrt(b ^ 2 - 4 * a * c)) / (2 * a)
truth.world {}
material { name = 'default', friction = 1.0, rolling_friction = 0 }
surface { rows = 9, columns = 9, actuator = pin {} }
local axis = { math.sin(tilt), 0, math.cos(tilt) }
local omega = { (spin - rate * math.cos(tilt)) * axis[1], 0, (spin - rate * math.cos(tilt)) * axis[3] + rate }
local v = truth.cross(omega, { l * axis[1], 0, l * axis[3] })
local id = cone { radius = radius, height = height, position = { 4 + l * axis[1], 4, l * axis[3] },
                  orientation = { axis = { 0, 1, 0 }, angle = math.pi + tilt }, velocity = v, angular_velocity = omega }
local least, greatest, angle, before = 180, 0, 0, 0
truth.sample(function()
  local now = truth.rotate(id, { 0, 0, -1 })
  local degrees = math.deg(math.acos(math.max(-1, math.min(1, now[3]))))
  least, greatest = math.min(least, degrees), math.max(greatest, degrees)
  local azimuth = math.atan(now[2], now[1])
  local step = azimuth - before
  angle = angle + step - 2 * math.pi * math.floor(step / (2 * math.pi) + 0.5)
  before = azimuth
end)
on_finish(function(t)
  metric('least', least)
  metric('greatest', greatest)
  metric('rate', angle / (t + truth.dt))
end)
