-- Elliptic rotors turn by an angle: the height of a box on them.
local truth = require 'truth'
local a, c, angle, axle = option('a', 0.4), option('c', 0.6), option('angle', 60.0), option('axle', -0.5)
truth.world {}
surface { rows = 8, columns = 16,
          actuator = rotor { command = 'angle', half_axes = { a, 0.4, c }, axle = axle, max_rate = 1, max_acceleration = 20 } }
local id = box { size = { 3, 3, 1 }, position = { 7, 3.5, axle + c + 0.5 } }
at(0, function()
  local all = {}
  for k = 1, cells.rows * cells.columns do all[k] = math.rad(angle) end
  cells:targets('angle', all)
end)
on_finish(function() metric('z', truth.position(id)[3] - 0.5) end)
