-- Two wheels with perpendicular axes in each cell: parcels turn into the eastern lane, then north. Run with wheels.aps.
surface { rows = 20, columns = 20, actuator = wheels { radius = 0.3, angle = math.rad(45), max_spin = 30 } }
for i = 1, 3 do
  box { size = {2, 2, 1}, position = {3, 3 + 4 * i, 0.5}, colour = 'green', label = 'parcel' }
end

on_finish(function()
  for i, parcel in ipairs(objects { label = 'parcel' }) do
    print(string.format('parcel %d is at %.1f, %.1f', i, parcel:position()))
  end
end)
