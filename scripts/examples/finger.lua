-- A finger with a magnet on it moves over an 8×8 table of electromagnets. The table feels where it is by its sensors and
-- makes it vibrate over a button that only the fingertip can feel. Run with finger.aps.
surface { rows = 8, columns = 8, pitch = 2, sensors = { proximity { range = 6 } },
          actuator = magnet { top = 1.6, strength = 300, depth = 1, law = 'pole' } }
local finger = capsule { radius = 0.8, height = 3, position = { 1, 8, 4 }, pole = 1, mass = 1, colour = 'pink', label = 'finger' }

-- The hand holds the finger as a damped spring does, and moves it east at 2 u/s. It does not yield to gravity.
local stiffness, damping = 400, 12
local swing = { button = { math.huge, -math.huge }, beside = { math.huge, -math.huge } }
on_tick(function(t)
  local x, y, z = object(finger):position()
  local vx, vy, vz = object(finger):velocity()
  object(finger):push { force = { stiffness * (1 + 2 * t - x) + damping * (2 - vx), stiffness * (8 - y) - damping * vy,
                                  stiffness * (4 - z) - damping * vz + 9.81 } }
  object(finger):teleport { orientation = { 0, 0, 0, 1 }, angular_velocity = { 0, 0, 0 } }
  local where = x > 6 and x < 10 and swing.button or (x > 2 and x < 4 or x > 12) and swing.beside
  if where then where[1], where[2] = math.min(where[1], z), math.max(where[2], z) end
end)
on_finish(function()
  print(string.format('the fingertip swings by %.3f u over the button, by %.3f u beside it',
                      swing.button[2] - swing.button[1], swing.beside[2] - swing.beside[1]))
end)
