-- All mechanisms on one table: a belt, belts in segments, pop-up wheels between rollers, steered wheels, three-wheel cells
-- and a turntable. Each parcel leaves where its label says; the script sees where parcels are, as light barriers would.
local conveyors = require 'conveyors'
world { off_table = 'remove' }
material { name = 'default', friction = 0.6, rolling_friction = 0 }
surface { rows = 12, columns = 48, actuators = { b = conveyor { top = 1 }, p = conveyor { top = 1, lift = { 0, 0.1 } } },
          cells = function(_, column) return column >= 17 and column <= 21 and column % 2 == 1 and 'p' or 'b' end }
local east, pop_ups = 3, function(_, column) return column >= 17 and column <= 21 and column % 2 == 1 end
local table_x, table_y = 37, 5.5

local labels, right, left = { 'north', 'south', 'turned', 'east' }, 0, 0
for i, label in ipairs(labels) do
  at(4 * (i - 1), function() box { size = { 3, 2, 1 }, position = { 2, 5.5, 0.5 }, label = label, velocity = { east, 0, 0 } } end)
end

-- The object with that label whose middle lies between two columns, and its x.
local function seen(label, from, to)
  for _, parcel in ipairs(objects { label = label }) do
    local x = parcel:position()
    if x >= from and x <= to then return parcel, x end
  end
end
local function heading(parcel)
  local x, y, z, w = parcel:orientation()
  return math.atan(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
end

at(0, function()
  conveyors.run({ 1, 1, 12, 48 }, conveyors.belt(0, east))
  conveyors.run({ 1, 9, 12, 16 }, conveyors.segments(0, { 0, 11.5 }, { east, 4 }))
  conveyors.run({ 1, 28, 12, 32 }, conveyors.omni(0.3, conveyors.wheel_speeds(0.3, east, 0, 0)))
end)
-- Calls f(value) when the value changes.
local last = {}
local function on_change(name, value, f)
  if last[name] ~= value then last[name] = value f(value) end
end
local step, rested, turned = 'carry', 0, {}
on_tick(function(t)
  on_change('pop-ups', seen('north', 18, 20) ~= nil, function(up)
    conveyors.run(pop_ups, up and conveyors.pop_up(math.pi / 2, 2, 0.1) or conveyors.pop_up(0, east, 0))
  end)
  on_change('diverter', seen('south', 21, 27) ~= nil, function(aside)
    conveyors.run({ 1, 22, 12, 27 }, conveyors.belt(aside and math.rad(-75) or 0, east))
  end)
  -- The turntable takes a parcel that has come to its middle, turns it north, and lets it rest before the belts go on: what
  -- still turns when it is driven on turns further.
  local parcel = seen('turned', step == 'carry' and table_x or 0, 48)
  if parcel and step == 'carry' and not turned[parcel:id()] then step = 'turn' end
  if step == 'turn' and heading(parcel) > math.pi / 2 - 0.02 then step, rested = 'rest', t + 0.5 end
  if step == 'rest' and t > rested then step, turned[parcel:id()] = 'carry', true end
  on_change('turntable', step, function()
    conveyors.run(conveyors.disc(table_x, table_y, 5), step == 'carry' and conveyors.belt(0, east) or
                  conveyors.turntable(table_x, table_y, step == 'turn' and 1 or 0))
  end)
end)
on_leave(function(id)
  local parcel = object(id)
  local x, y = parcel:position()
  local label, angle = parcel:label(), heading(parcel)
  local exit = y > 11 and 'north' or y < 0 and 'south' or math.abs(angle - math.pi / 2) < 0.2 and 'turned' or 'east'
  left = left + 1
  if exit == label then right = right + 1 end
end)
success(function() return right == #labels end)
on_finish(function() print(right .. ' of ' .. #labels .. ' parcels left where they should') end)
