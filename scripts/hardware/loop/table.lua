-- The table of docs/from-hardware.md as its maker declares it: 16×16 pillars with encoders and distance sensors, 100 control periods a
-- second. A ball is to roll to the middle and to stay there.
--   scene = 'task'      one episode of 2 s, with the ball at a random place: to learn from
--   scene = 'ball'      the ball lies in the middle: to identify its rolling friction
--   scene = 'cells'     no ball: to calibrate and to identify the pillars
--   scene = 'episodes'  an operator places the ball anew every 0.9 s, and counts `episodes` times, after the first
world { unit = 'cm', control_period = 0.01, dt = 0.0025, seed = option('seed', 1, 'of the places of the ball') }
local scene = option('scene', 'task', 'see above', { 'task', 'ball', 'cells', 'episodes' })
local episodes = option('episodes', 20, 'of scene episodes', { 1, 100000 })
material { name = 'foam', friction = 0.6, rolling_friction = 0.05, restitution = 0 }
surface { rows = 16, columns = 16, pitch = 1.7, material = 'foam',
          actuator = pin { top = 1.6, range = { 0, 5.5 }, max_speed = 20, max_acceleration = 400 },
          sensors = { pin_height {}, proximity { range = 6 } } }

local LEARN_S, JUDGE_S, MIDDLE, NEAR = 2, 0.9, 7.5 * 1.7, 0.3
local ball
if scene ~= 'cells' then
  local at = scene == 'ball' and { MIDDLE, MIDDLE, 5 } or { random(6, 19.5), random(6, 19.5), 9.5 }
  ball = sphere { radius = 4, mass = 0.1, position = at, material = 'foam', colour = 'orange', label = 'ball' }
end

local function distance()
  local x, y = object(ball):position()
  return math.sqrt((x - MIDDLE) ^ 2 + (y - MIDDLE) ^ 2)
end
if scene == 'task' then
  episode { seconds = LEARN_S }
  reward(function() return -math.min(distance(), 10) / 10 end)
  local sum, ticks, last = 0, 0, 0
  on_tick(function(t)
    sum, ticks = sum + math.min(distance(), 10), ticks + 1
    last = t < LEARN_S - 0.5 and 0 or last + math.min(distance(), 10) / 50
  end)
  on_finish(function()
    metric('success', distance() < NEAR and 1 or 0)
    metric('score', -sum / ticks - last)
  end)
end
if scene == 'episodes' then
  local period, won, sum = math.floor(JUDGE_S / 0.01 + 0.5), 0, 0
  on_tick(function(_, tick)
    if tick == 0 or tick % period ~= 0 then return end
    local episode = tick // period - 1  -- in the first one the controller may have been late
    if episode > 0 then
      won, sum = won + (distance() < NEAR and 1 or 0), sum + distance()
      metric('won', won)
      metric('distance_cm', sum / episode)
      if episode >= episodes then return quit() end
    end
    object(ball):teleport { position = { random(6, 19.5), random(6, 19.5), 9.5 }, velocity = { 0, 0, 0 }, angular_velocity = { 0, 0, 0 } }
  end)
end
