-- Elliptic cams on horizontal axles lift a plate twice a turn and drag it along. Run with rotor.aps.
surface { rows = 16, columns = 32,
          actuator = rotor { axis = {0, 1, 0}, half_axes = {0.5, 0.4, 0.35}, axle = -0.5, max_rate = 10 } }
box { size = {6, 6, 0.5}, position = {6, 7.5, 0.3}, colour = 'cyan', label = 'plate' }

on_finish(function() print(string.format('the plate went %.2f u east', object(0):position() - 6)) end)
