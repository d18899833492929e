-- A small table that is to be identified: pins with encoders, on which the script moves each pin by itself, in steps of all sizes.
-- With drive = 'none' it moves nothing, so that boards over this table command the pins; with drive = 'bowl' likewise, and a ball lies
-- in the middle. With drive = 'ball' the pins lie level, and a ball falls onto them, bounces and rolls to rest. For that, the pins' gains and
-- offsets are known by then: FILE of the option `known`, a map of faults as identification writes it.
world { control_period = 0.01, dt = 0.0025, seed = option('seed', 1, 'of the commands and of the errors of sensors') }
material { name = 'rubber', friction = 0.6, rolling_friction = 0.05, restitution = 0.4 }
material { name = 'top', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 10, columns = 10, material = 'top', border = { height = 6 },
          actuator = pin { range = { 0, 5 }, max_speed = 12, max_acceleration = 200 },
          sensors = { pin_height {}, proximity { range = 6 }, pressure {} } }
record { sensors = true, actuators = true }

local drive = option('drive', 'cells', 'what the script does', { 'cells', 'ball', 'none', 'bowl' })
local known = option('known', '', 'file of gains and offsets of the pins')

local gain, offset = {}, {}
if known ~= '' then
  for line in io.lines(known) do
    local row, column, fault, value = line:match('^(%d+),(%d+),height,(%a+),([%d.e+-]+)$')
    if row then (fault == 'gain' and gain or fault == 'offset' and offset or {})[row * cells.columns + column + 1] = tonumber(value) end
  end
end
if drive == 'ball' then
  sphere { radius = 1.3, mass = 3, position = { 2.6, 2.9, 4.6 }, velocity = { 1.8, 1.5, 0 }, material = 'rubber', label = 'ball' }
elseif drive == 'bowl' then
  sphere { radius = 1.3, mass = 3, position = { 4.5, 4.5, 3 }, material = 'rubber', label = 'ball' }
end

local heights, left = {}, {}
on_tick(function()
  if drive == 'none' or drive == 'bowl' then return end
  for cell = 1, cells.rows * cells.columns do
    if drive == 'ball' then
      heights[cell] = (2 - (offset[cell] or 0)) / (gain[cell] or 1)
    else
      left[cell] = (left[cell] or 0) - 1
      if left[cell] <= 0 then
        local is_small = random() < 0.5
        local around = (heights[cell] or 2.5) + random(-0.3, 0.3)
        heights[cell] = is_small and math.min(4.5, math.max(0.5, around)) or random(0.5, 4.5)
        left[cell] = math.floor(is_small and random(3, 15) or random(20, 70))
      end
    end
  end
  cells:targets('height', heights)
end)
at(option('seconds', 12, 'length of the run, s'), quit)
