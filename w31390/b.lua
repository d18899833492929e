surface { rows = 4, columns = 4, actuator = pin { range = {0, 2} } }
sphere { radius = 0.5, position = { 2, 2, 3 } }
on_tick(function(t) end)
