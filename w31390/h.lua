surface { rows = 4, columns = 4, actuator = pin { range = {0, 2} } }
sphere { radius = 0.5, position = { 2, 2, 3 } }
local function f(n) local ok, e = pcall(f) error(e) end while true do pcall(f) end
