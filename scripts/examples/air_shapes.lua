-- Jets of air recognise five kinds of sheet by what their sensors see and carry each to its own region, without touching it.
-- Run with air_shapes.aps; its switch `truth` has the simulator tell the kinds instead.
world { seed = option('seed', 1, 'of the places and turns') }
local kinds = option('kinds', 'letter disc', 'of the sheets, at most six: letter, card, frame, disc, triangle')

local dead = option('dead', 0, 'share of dead sensors')

surface { rows = 32, columns = 48, actuator = air_jet { lean = 0.12, max_flow = 60 },
          sensors = { proximity { range = 8, dead = dead }, object_type {} } }
record { actuators = true }

local corners = {}
for i = 0, 2 do
  for _, z in ipairs { -0.1, 0.1 } do
    table.insert(corners, { 6.2 * math.cos(2 * math.pi * i / 3), 6.2 * math.sin(2 * math.pi * i / 3), z })
  end
end
-- In the order of the numbers by which the program knows them; all weigh the same per area.
local shapes = {
  { 'letter', 25, function(o) o.size = { 5, 5, 0.2 } return box(o) end },
  { 'card', 24, function(o) o.size = { 8, 3, 0.2 } return box(o) end },
  { 'frame', 48, function(o) o.file = 'models/frame.obj' return mesh(o) end },
  { 'disc', 50, function(o) o.radius, o.height = 4, 0.2 return cylinder(o) end },
  { 'triangle', 50, function(o) o.points = corners return hull(o) end },
}
local places = {}
for _, y in ipairs { 8, 23 } do
  for _, x in ipairs { 8, 23.5, 39 } do places[#places + 1] = { x, y } end
end
local sheets = {}
local function add(shape, position, yaw)
  return shape[3] { position = position, orientation = { yaw = yaw }, mass = 0.048 * shape[2], label = shape[1], colour = 'yellow' }
end
for name in kinds:gmatch '%S+' do
  local shape
  for _, known in ipairs(shapes) do if known[1] == name then shape = known end end
  if not shape then error("kinds: no '" .. name .. "'; there are letter, card, frame, disc, triangle") end
  local place = table.remove(places, math.floor(random(1, #places + 1)))
  if not place then error('kinds: at most six sheets have a place') end
  sheets[#sheets + 1] = add(shape, { place[1] + random(-1, 1), place[2] + random(-1, 1), 0.6 }, random(0, 2 * math.pi))
end

local low = math.huge
on_tick(function(t)
  for _, id in ipairs(sheets) do
    local _, _, z = object(id):position()
    if t > 1 then low = math.min(low, z - 0.1) end
  end
end)
on_finish(function()
  for _, id in ipairs(sheets) do
    print(string.format('the %s is at %.2f, %.2f', object(id):label(), object(id):position()))
  end
  print(string.format('none came nearer than %.2f u', low))
end)
