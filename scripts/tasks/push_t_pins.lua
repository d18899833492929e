-- Push-T on pins: a T on 32×32 pins of little friction is to cover its goal in the middle, from anywhere and however it is
-- turned. The goal's edges lie between rows and columns of pins.
local side = 32
material { name = 'ptfe', friction = 0.1, restitution = 0 }
surface { rows = side, columns = side, material = 'ptfe', sensors = { proximity { range = 10 } },
          actuator = pin { range = { 0, 6 }, max_speed = 6, max_acceleration = 60 } }
require 'tee' { side = side, goal = { x = 15.5, y = 16.5 - 15 / 14, yaw = 0 }, seconds = 40, material = 'ptfe' }
