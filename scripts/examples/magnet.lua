-- Electromagnets of both signs under 8 × 8 cells: a current that moves on from coil to coil takes one pole along, pushes
-- the other away, and leaves what is not magnetic where it is. Run with magnet.aps.
surface { rows = 8, columns = 8, pitch = 2, actuator = magnet { top = 1.6, strength = 150, depth = 1, law = 'pole' } }
cylinder { radius = 0.9, height = 0.6, position = {2, 6, 0.3}, colour = 'red', pole = 1, label = 'pulled' }
cylinder { radius = 0.9, height = 0.6, position = {10, 6, 0.3}, colour = 'blue', pole = -1, label = 'pushed' }
cylinder { radius = 0.9, height = 0.6, position = {2, 12, 0.3}, colour = 'grey', label = 'plain' }

on_finish(function()
  for id = 0, 2 do
    print(string.format('%s is at %.2f, %.2f', object(id):label(), object(id):position()))
  end
end)
