-- Belts, rollers, diverters, pop-up wheels, omni-wheel hexagons and turntables from cells of the actuator `conveyor`. Each
-- function returns what a cell of that mechanism does: drive_x, drive_y (u/s), turn (rad/s) and lift (u) as functions of
-- the cell's centre. `conveyors.run` gives these commands to the cells of a region.
local conveyors = {}

-- A region is a list {north row, west column, south row, east column} or a function (row, column).
function conveyors.run(region, mechanism)
  local r1, c1, r2, c2 = 1, 1, cells.rows, cells.columns
  if type(region) == 'table' then r1, c1, r2, c2 = table.unpack(region) end
  for row = r1, r2 do
    for column = c1, c2 do
      if type(region) == 'table' or region(row, column) then
        local x, y, turn, lift = mechanism(cells:centre(row, column))
        cells:target('drive_x', row, column, x)
        cells:target('drive_y', row, column, y)
        cells:target('turn', row, column, turn or 0)
        if lift then cells:target('lift', row, column, lift) end
      end
    end
  end
end

-- A belt of that heading (rad from east). Powered rollers are the same where their tops are as narrow as a roller, and so
-- are steered wheels, which diverters turn to another heading.
function conveyors.belt(heading, speed)
  local x, y = speed * math.cos(heading), speed * math.sin(heading)
  return function() return x, y end
end

-- Belts behind each other: segment i begins at `starts[i]` along the heading, u from the origin, and runs at `speeds[i]`.
function conveyors.segments(heading, starts, speeds)
  local ex, ey = math.cos(heading), math.sin(heading)
  return function(x, y)
    local speed = 0
    for i, start in ipairs(starts) do if x * ex + y * ey >= start then speed = speeds[i] end end
    return speed * ex, speed * ey
  end
end

-- Wheels between rollers that rise by `lift` and drive across them. With a lift of 0 they are level with the rollers.
function conveyors.pop_up(heading, speed, lift)
  local x, y = speed * math.cos(heading), speed * math.sin(heading)
  return function() return x, y, 0, lift end
end

-- A hexagon of three omnidirectional wheels at 90°, 210° and 330°, `radius` from its middle, which drive counter-clockwise
-- around it at these speeds of their rims.
function conveyors.omni(radius, a, b, c)
  local x, y, turn = 0, 0, (a + b + c) / (3 * radius)
  for i, speed in ipairs { a, b, c } do
    local at = math.rad(120 * i - 30)
    x, y = x - 2 / 3 * speed * math.sin(at), y + 2 / 3 * speed * math.cos(at)
  end
  return function() return x, y, turn end
end

-- The speeds of these wheels for a velocity and a spin of the hexagon's top.
function conveyors.wheel_speeds(radius, x, y, turn)
  local speeds = {}
  for i = 1, 3 do
    local at = math.rad(120 * i - 30)
    speeds[i] = turn * radius - x * math.sin(at) + y * math.cos(at)
  end
  return table.unpack(speeds)
end

-- A disc that turns about (x, y) at that rate, and the region of the cells whose centres lie on it.
function conveyors.turntable(x, y, rate)
  return function(cx, cy) return rate * (y - cy), rate * (cx - x), rate end
end
function conveyors.disc(x, y, radius)
  return function(row, column)
    local cx, cy = cells:centre(row, column)
    return (cx - x) ^ 2 + (cy - y) ^ 2 <= radius ^ 2
  end
end

return conveyors
