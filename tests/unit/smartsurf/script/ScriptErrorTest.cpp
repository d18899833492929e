// Exact error messages for all kinds of user errors.
#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

using ErrorTest = ScriptTest;

struct Mistake {
  const char* script;
  const char* message;
};

class MistakeTest : public ScriptTest, public testing::WithParamInterface<Mistake> {};

TEST_P(MistakeTest, GivesExpectedMessage) { EXPECT_EQ(error_of(GetParam().script), GetParam().message); }

INSTANTIATE_TEST_SUITE_P(
    TableReader, MistakeTest,
    testing::Values(
        Mistake{"\n\nsphere{raduis = 1, position = {0, 0, 0}}",
                "t.lua:3: sphere: unknown field 'raduis' (did you mean 'radius'?)"},
        Mistake{
            "world{color = 1}",
            "t.lua:1: world: unknown field 'color'; known: unit, gravity, dt, iterations, control_period, "
            "seed, ground, sleep, off_table, engine"},
        Mistake{"sphere{\n  radius = 1,\n  position = {0, 0, 'high'}}",
                "t.lua:1: sphere.position[3] = 'high': must be a number"},
        Mistake{"sphere{radius = 'big', position = {0, 0, 0}}",
                "t.lua:1: sphere.radius = 'big': must be a number"},
        Mistake{"sphere{radius = '2', position = {0, 0, 0}}",
                "t.lua:1: sphere.radius = '2': must be a number"},
        Mistake{"sphere{radius = -1, position = {0, 0, 0}}",
                "t.lua:1: sphere.radius = -1: must be in [0.001, 1000000]"},
        Mistake{"sphere{radius = 0/0, position = {0, 0, 0}}", "t.lua:1: sphere.radius = nan: must be finite"},
        Mistake{"sphere{radius = 1, position = {0, 1/0, 0}}",
                "t.lua:1: sphere.position[2] = inf: must be finite"},
        Mistake{"sphere{radius = 1, position = {0, 1e300, 0}}",
                "t.lua:1: sphere.position[2] = 1e+300: must be in [-1000000, 1000000]"},
        Mistake{"metric('error', 'small')", "t.lua:1: metric: value = 'small': must be a number"},
        Mistake{"metric('', 1)", "t.lua:1: metric: name = '': must be a string of 1 to 64 characters"},
        Mistake{"sphere{radius = 1, position = {1, 2}}",
                "t.lua:1: sphere.position = a table of 2 values: must be three numbers {x, y, z}"},
        Mistake{"sphere{radius = 1, position = 3}",
                "t.lua:1: sphere.position = 3: must be three numbers {x, y, z}"},
        Mistake{"sphere{radius = 1, position = {x = 1, y = 2}}",
                "t.lua:1: sphere.position: the field 'z' is missing"},
        Mistake{"sphere{position = {0, 0, 0}}", "t.lua:1: sphere: the field 'radius' is missing"},
        Mistake{"sphere{radius = 1}", "t.lua:1: sphere: the field 'position' is missing"},
        Mistake{"sphere(5)", "t.lua:1: sphere: takes a table of fields, sphere{radius = ...}, not 5"},
        Mistake{"sphere()", "t.lua:1: sphere: takes a table of fields, sphere{radius = ...}, not nil"},
        Mistake{
            "sphere{1, 2}",
            "t.lua:1: sphere: a value without a field name; known: radius, position, orientation, velocity, "
            "angular_velocity, mass, com, inertia, friction, fixed, material, colour, label, pole, moment"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, fixed = 1}",
                "t.lua:1: sphere.fixed = 1: must be true or false"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, label = 3}",
                "t.lua:1: sphere.label = 3: must be a string"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, mass = 0}",
                "t.lua:1: sphere.mass = 0: must be in [1e-09, 1e+12]"},
        Mistake{"material{name = 'steel'}\nsphere{radius = 1, position = {0, 0, 0}, material = 'stel'}",
                "t.lua:2: sphere.material = 'stel': no such material (did you mean 'steel'?)"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, material = 'wood'}",
                "t.lua:1: sphere.material = 'wood': no such material; known: default; declare it first with "
                "material{}"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, colour = 'gren'}",
                "t.lua:1: sphere.colour = 'gren': no such colour (did you mean 'green'?)"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, colour = '#12345'}",
                "t.lua:1: sphere.colour = '#12345': must be '#rrggbb', six hexadecimal digits"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, colour = {1, 2, 0}}",
                "t.lua:1: sphere.colour[2] = 2: must be in [0, 1]"},
        Mistake{"box{size = {1, 0, 1}, position = {0, 0, 0}}",
                "t.lua:1: box.size[2] = 0: must be in [0.001, 1000000]"},
        Mistake{"box{size = {1, 1, 1}, position = {0, 0, 0}, orientation = {0, 0, 0, 0}}",
                "t.lua:1: box.orientation: a quaternion must not be of length 0"},
        Mistake{"box{size = {1, 1, 1}, position = {0, 0, 0}, orientation = {axis = {0, 0, 1}}}",
                "t.lua:1: box.orientation: the field 'angle' is missing"},
        Mistake{"cylinder{radius = 1, position = {0, 0, 0}}",
                "t.lua:1: cylinder: the field 'height' is missing"}));

INSTANTIATE_TEST_SUITE_P(
    Declarations, MistakeTest,
    testing::Values(
        Mistake{"world{dt = 0}", "t.lua:1: world.dt = 0: must be in [1e-05, 0.1] seconds"},
        Mistake{
            "world{dt = 0.001}",
            "t.lua:1: world.control_period = 0.0166666666667: must be an integer number of physics steps, "
            "world.dt = 0.001"},
        Mistake{"world{iterations = 2.5}",
                "t.lua:1: world.iterations = 2.5: must be an integer from 1 to 1000"},
        Mistake{"world{seed = -1}", "t.lua:1: world.seed = -1: must be an integer, 0 or more"},
        Mistake{"world{gravity = 'down'}",
                "t.lua:1: world.gravity = 'down': must be a number (along z) or {x, y, z}"},
        Mistake{"world{}\nworld{}", "t.lua:2: world: already declared at t.lua:1"},
        Mistake{"surface{}\n\nsurface{}", "t.lua:3: surface: already declared at t.lua:1"},
        Mistake{"surface{rows = 0}", "t.lua:1: surface.rows = 0: must be an integer from 1 to 4096"},
        Mistake{"surface{actuator = 'pin'}",
                "t.lua:1: surface.actuator = 'pin': must be an actuator, pin{...}"},
        Mistake{"surface{actuator = proximity{}}",
                "t.lua:1: surface.actuator = a userdata: must be an actuator, pin{...}"},
        Mistake{"surface{actuator = pin{top = 2}}",
                "t.lua:1: pin.top[1] = 2: must be in [0.001, pitch], the pitch is 1"},
        Mistake{"surface{actuator = pin{range = {3, 1}}}",
                "t.lua:1: pin.range[2] = 1: must be not below pin.range[1] = 3"},
        Mistake{"surface{actuator = pin{\n max_sped = 1}}",
                "t.lua:1: pin: unknown field 'max_sped' (did you mean 'max_speed'?)"},
        Mistake{"surface{sensors = {8}}",
                "t.lua:1: surface.sensors[1] = 8: must be a sensor, proximity{range = ...}"},
        Mistake{"surface{sensors = {proximity{}, proximity{}}}",
                "t.lua:1: surface.sensors: two sensors are called 'proximity'; rename one, "
                "proximity{name = ...}"},
        Mistake{"surface{sensors = {proximity{range = 0}}}",
                "t.lua:1: proximity.range = 0: must be greater than 0"},
        Mistake{"surface{sensors = {proximity{name = 'a b'}}}",
                "t.lua:1: proximity.name = 'a b': must be 1 to 27 letters, digits and _, a letter first"},
        Mistake{"surface{border = 6}",
                "t.lua:1: surface.border: takes a table of fields, surface.border{height = "
                "...}, not 6"},
        Mistake{"material{friction = 1}", "t.lua:1: material: the field 'name' is missing"},
        Mistake{"material{name = 'a', restitution = 1.5}",
                "t.lua:1: material.restitution = 1.5: must be in [0, 1]"},
        Mistake{"material{name = 'a'}\nmaterial{name = 'a'}",
                "t.lua:2: material 'a': already declared at t.lua:1"},
        Mistake{"record{every = 0}", "t.lua:1: record.every = 0: must be an integer from 1 to 1000000"},
        Mistake{"return {speed = 3}",
                "t.lua: no surface is declared, and the script returns a table: it looks like a module; "
                "check an experiment that requires it"},
        Mistake{"surface{rows = 2, columns = 2, mask = function() return false end}",
                "t.lua:1: surface: all cells are empty: cells, mask and positions exclude every cell"},
        Mistake{"-- nothing",
                "t.lua: no surface is declared; an experiment needs one, surface{rows = 64, columns = "
                "64, sensors = {proximity{}}}"}));

INSTANTIATE_TEST_SUITE_P(
    OfLua, MistakeTest,
    testing::Values(
        Mistake{"\nspere{radius = 1}", "t.lua:2: unknown name 'spere' (did you mean 'sphere'?)"},
        Mistake{"\ncube{size = 1}", "t.lua:2: unknown name 'cube'; write box{size = {x, y, z}}"},
        Mistake{
            "ball{radius = 1, position = {0, 0, 0}}",
            "t.lua:1: ball: is an actuator, surface{actuator = ball{...}}, without a position; the objects "
            "are sphere, box, cylinder, capsule, cone, hull and mesh"},
        Mistake{"local r = 2\nsphere{radius = rr, position = {0, 0, 0}}", "t.lua:2: unknown name 'rr'"},
        Mistake{"sphere{radius = 1,\n\nposition = }", "t.lua:3: unexpected symbol near '}'"},
        Mistake{"for i = 1, 3 do", "t.lua:1: 'end' expected near <eof>"},
        Mistake{"local t = nil\nt.x = 1", "t.lua:2: attempt to index a nil value (local 't')"},
        Mistake{"error('my own')", "t.lua:1: my own"},
        Mistake{"\nerror('two\\nlines', 0)", "t.lua:2: two lines"},
        Mistake{"\nerror({})", "t.lua:2: the script raised an error value of type table"},
        Mistake{"local f = coroutine.wrap(function()\nerror('inside')\nend)\nf()", "t.lua:2: inside"},
        Mistake{"local function f() return f() + 1 end\nf()", "t.lua:1: stack overflow"},
        Mistake{"math.random(0, -1)", "t.lua:1: math.random: low = 0 is above high = -1"},
        Mistake{"random(2)", "t.lua:1: random: takes random(low, high), or random() for [0, 1)"},
        Mistake{"random(2, 1)", "t.lua:1: random: low = 2 is above high = 1"},
        Mistake{
            "math.randomseed(1)",
            "t.lua:1: math.randomseed: the experiment has one seed; set it with world{seed = ...} or --seed"},
        Mistake{"option('n', {})",
                "t.lua:1: option 'n': default = a table: must be a number, a string, true or false"},
        Mistake{"option('n', 0/0)", "t.lua:1: option 'n' = nan: must be finite"},
        Mistake{"option('a b', 1)",
                "t.lua:1: option: name = 'a b': must be 1 to 60 letters, digits, _ and -, a letter first"},
        Mistake{"option('n', 1)\noption('n', 1)", "t.lua:2: option 'n': already declared at t.lua:1"},
        Mistake{"at(-1, print)", "t.lua:1: at: seconds = -1: must be from 0 to 1e9"},
        Mistake{"at(1)", "t.lua:1: at: function = nil: must be a function"},
        Mistake{"every(0, print)", "t.lua:1: every: seconds = 0: must be from 0.0001 to 1e9"},
        Mistake{"on_tick(5)", "t.lua:1: on_tick: function = 5: must be a function"},
        Mistake{"object { shape = 'sphere' }",
                "t.lua:1: object: takes an object's id; sphere { … }, box { … } and their like make objects"},
        Mistake{"stop()",
                "t.lua:1: stop: there is no simulation while the script loads; call it inside a function "
                "given to at, every, on_tick or on_finish"},
        Mistake{
            "cells:target('height', 1, 1, 2)",
            "t.lua:1: cells:target: there is no simulation while the script loads; call it inside a function "
            "given to at, every, on_tick or on_finish"},
        Mistake{"pace('fast')",
                "t.lua:1: pace = 'fast': must be 'max', 'realtime' or a factor greater than 0"},
        Mistake{"print(cells.rows)", "t.lua:1: cells.rows: no surface{} is declared so far"},
        Mistake{"metric('a', print)\nmetric('a', print)", "t.lua:2: metric 'a': already declared at t.lua:1"},
        Mistake{"metric('a', print)\nmetric('a', 1)",
                "t.lua:2: metric 'a': already declared at t.lua:1, as a function"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}}\ninfo{a = 0, b = 1}",
                "t.lua:2: info.b = 1: there is no such object; create it before info{}"},
        Mistake{"info{a = -1}", "t.lua:1: info.a = -1: there is no such object; create it before info{}"},
        Mistake{"string.format('%d', 1.5)",
                "t.lua:1: bad argument #2 to 'format' (number has no integer representation)"},
        Mistake{"cells:tagret()", "t.lua:1: cells: has no 'tagret' (did you mean 'target'?)"},
        Mistake{"print(cells.row)", "t.lua:1: cells: has no 'row' (did you mean 'rows'?)"},
        Mistake{
            "print(cells[1])",
            "t.lua:1: cells: has no 1; known: centre, columns, pitch, rows, sense, target, targets, truth"}));

INSTANTIATE_TEST_SUITE_P(
    InActuatorsAndLayouts, MistakeTest,
    testing::Values(
        Mistake{"wheels{radius = 0}", "t.lua:1: wheels.radius = 0: must be greater than 0"},
        Mistake{"ball{max_spinn = 3}", "t.lua:1: ball: unknown field 'max_spinn' (did you mean 'max_spin'?)"},
        Mistake{"magnet{law = 'monopole'}", "t.lua:1: magnet.law = 'monopole': must be one of dipole, pole"},
        Mistake{"rotor{axis = {0, 0, 0}}", "t.lua:1: rotor.axis: must not be of length 0"},
        Mistake{"rotor{points = {{0, 0, 1}}}",
                "t.lua:1: rotor.points: must be at least four points {x, y, z}"},
        Mistake{"tile{latency = 1.5}", "t.lua:1: tile.latency = 1.5: must be an integer from 0 to 1000"},
        Mistake{"pin{tip = 'cone'}",
                "t.lua:1: pin.tip = 'cone': must be a table of shape, radius, half_angle, corner_radius"},
        Mistake{"pin{tip = {shape = 'spike'}}",
                "t.lua:1: pin.tip.shape = 'spike': must be one of flat, hemisphere, cone, rounded_square"},
        Mistake{"pin{tip = {shape = 'cone', angel = 1}}",
                "t.lua:1: pin.tip: unknown field 'angel'; known: shape, radius, half_angle, corner_radius"},
        Mistake{"pin{tip = {shape = 'cone', half_angle = 2}}",
                "t.lua:1: pin.tip.half_angle = 2: must be in [0.05, 1.5]"},
        Mistake{"pin{tip = {shape = 'hemisphere', radius = 0}}",
                "t.lua:1: pin.tip.radius = 0: must be greater than 0"},
        Mistake{"pin{tip = {shape = 'hemisphere', half_angle = 1}}",
                "t.lua:1: pin.tip.half_angle: a tip of the shape 'hemisphere' has none"},
        Mistake{"pin{max_force = 9, tip = {shape = 'cone'}}",
                "t.lua:1: pin.max_force: a tip of the shape 'cone' has none; only flat pins are of limited "
                "force"},
        Mistake{"pin{stiffness = 9, tip = {shape = 'cone'}}",
                "t.lua:1: pin.stiffness: a tip of the shape 'cone' has none; only flat pins yield"},
        Mistake{"pin{stiffness = 9, max_force = 9}",
                "t.lua:1: pin.stiffness: excludes pin.max_force; a pin has one of them"},
        Mistake{"pin{stiffness = 0}", "t.lua:1: pin.stiffness = 0: must be greater than 0"},
        Mistake{"pin{damping = 1}", "t.lua:1: pin.damping: needs pin.stiffness; a rigid pin has none"},
        Mistake{"pin{tip = {radius = 0.2}}", "t.lua:1: pin.tip.radius: a tip of the shape 'flat' has none"},
        Mistake{
            "surface{pitch = 2, actuator = pin{top = {1, 1.5}, tip = {shape = 'hemisphere', radius = 0.6}}}",
            "t.lua:1: pin.tip.radius = 0.6: must be in (0, 0.5], half of the top's shorter edge"},
        Mistake{"delta{tip = {shape = 'cone'}}",
                "t.lua:1: delta.tip.shape = 'cone': must be one of sphere, rounded_cylinder"},
        Mistake{"delta{tip = {length = 1}}",
                "t.lua:1: delta.tip.length: a tip of the shape 'sphere' has none"},
        Mistake{"delta{tip = {shape = 'rounded_cylinder', radius = 0.5, length = 0.8}}",
                "t.lua:1: delta.tip.length = 0.8: must be at least the diameter of the tip, 1"},
        Mistake{"delta{workspace = 1}", "t.lua:1: delta.workspace = 1: must be a table of radius, z"},
        Mistake{"delta{workspace = {radius = 0}}",
                "t.lua:1: delta.workspace.radius = 0: must be greater than 0"},
        Mistake{"delta{workspace = {z = {2, 1}}}",
                "t.lua:1: delta.workspace.z[2] = 1: must be not below delta.workspace.z[1] = 2"},
        Mistake{
            "delta{arms = {length = 1, radius = 0.6}}",
            "t.lua:1: delta.arms.length = 1: must be greater than workspace.radius + arms.radius = 1.1, to "
            "reach the whole workspace"},
        Mistake{"delta{damping = 1}", "t.lua:1: delta.damping: needs delta.stiffness"},
        Mistake{"surface{rows = 4, columns = 4, skin = 1}",
                "t.lua:1: surface.skin: takes a table of fields, surface.skin{kind = ...}, not 1"},
        Mistake{"surface{rows = 4, columns = 4, skin = {kind = 'stiff'}}",
                "t.lua:1: surface.skin.kind = 'stiff': must be 'kinematic' or 'elastic'"},
        Mistake{"surface{rows = 4, columns = 4, skin = {tension = 5}}",
                "t.lua:1: surface.skin.tension: a skin of the kind 'kinematic' has none"},
        Mistake{"surface{rows = 4, columns = 4, skin = {kind = 'elastic', density = 0}}",
                "t.lua:1: surface.skin.density = 0: must be in [1e-09, 1000000]"},
        Mistake{"surface{rows = 4, columns = 4, skin = {nodes = {9, 8}}}",
                "t.lua:1: surface.skin.nodes[2] = 8: must be 9 to 512, two for each pitch"},
        Mistake{"surface{rows = 4, columns = 4, skin = {nodes = {9, 9.5}}}",
                "t.lua:1: surface.skin.nodes = a table: must be {rows, columns}, two integers"},
        Mistake{"surface{rows = 4, columns = 4, skin = {margin = 2}}",
                "t.lua:1: surface.skin.margin = 2: must be in [0, 1], the pitch"},
        Mistake{"surface{rows = 4, columns = 4, skin = {edge = 'clamped'}}",
                "t.lua:1: surface.skin.edge = 'clamped': must be 'free' or {height = z}"},
        Mistake{"surface{rows = 4, columns = 4, actuator = ball{}, skin = {}}",
                "t.lua:1: surface.skin: over 'ball': must be over tiles of the command 'pose', pins or "
                "deltas, without "
                "max_force and stiffness"},
        Mistake{"surface{rows = 4, columns = 4, actuator = pin{max_force = 1}, skin = {}}",
                "t.lua:1: surface.skin: over 'pin': must be over tiles of the command 'pose', pins or "
                "deltas, without "
                "max_force and stiffness"},
        Mistake{
            "surface{rows = 4, columns = 4, layout = 'hex', skin = {}}",
            "t.lua:1: surface.skin: needs the rectangular layout: without layout, positions or module gaps"},
        Mistake{"surface{rows = 2, columns = 2, border = {height = 1}, skin = {}}",
                "t.lua:1: surface.skin: there is no actuator under it"},
        Mistake{"surface{rows = 4, columns = 4, sensors = {skin_height{}}}",
                "t.lua:1: surface.skin: is absent: must be there for the sensor 'skin_height'"},
        Mistake{"tile{command = 'tilt'}", "t.lua:1: tile.command = 'tilt': must be one of wave, pose"},
        Mistake{"tile{max_tilt = 1.5}", "t.lua:1: tile.max_tilt = 1.5: must be in [0, 1.2]"},
        Mistake{"tile{heave = {2, 1}}", "t.lua:1: tile.heave[2] = 1: must be not below tile.heave[1] = 2"},
        Mistake{"tile{command = 'pose', thickness = 0}",
                "t.lua:1: tile.thickness = 0: must be at least 0.001 where the command is a pose"},
        Mistake{"air_jet{lean = 4}", "t.lua:1: air_jet.lean = 4: must be in [0, 1.57079632679]"},
        Mistake{"surface{actuators = {pin{}, ball{}}}",
                "t.lua:1: surface.actuators: 2 actuators need surface.cells to assign them"},
        Mistake{"surface{actuator = pin{}, actuators = {pin{}}}",
                "t.lua:1: surface: give actuator or actuators, not both"},
        Mistake{"surface{rows = 2, columns = 2, actuators = {p = pin{top = 0.8}, b = ball{top = 0.5}}, cells "
                "= {'pb'}}",
                "t.lua:1: pin.top: {0.8, 0.8}: must be that of the surface's ball, {0.5, 0.5}: all cells are "
                "of one size"},
        Mistake{"surface{rows = 2, columns = 3, actuators = {p = pin{}, b = ball{}}, cells = {'pb'}}",
                "t.lua:1: surface.cells: a pattern of 1 × 2 does not repeat evenly on 2 × 3 cells"},
        Mistake{"surface{rows = 2, columns = 2, actuators = {p = pin{}, b = ball{}}, cells = {'px'}}",
                "t.lua:1: surface.cells at (1, 2) = 'x': must be one of b, p, or nil for an empty cell"},
        Mistake{"surface{rows = 2, columns = 2, actuators = {pin{}, ball{}}, cells = function(r, c) return 3 "
                "end}",
                "t.lua:1: surface.cells at (1, 1) = 3: must be one of 1, 2, or nil for an empty cell"},
        Mistake{"surface{rows = 2, columns = 2,\nmask = function(r, c)\n error('no')\n end}", "t.lua:3: no"},
        Mistake{"surface{layout = 'hexagonal'}",
                "t.lua:1: surface.layout = 'hexagonal': must be 'rectangular' or 'hex'"},
        Mistake{"surface{layout = 'hex', positions = {{0, 0}}}",
                "t.lua:1: surface: give only one of layout, positions and modules"},
        Mistake{"surface{rows = 1, columns = 1, positions = {{0, 0}, {1, 0}}}",
                "t.lua:1: surface.positions: 2 positions: must be at most rows × columns = 1"},
        Mistake{
            "surface{positions = {{0, 0},\n{1, 0}, {1.5, 0.1, 0.25}}}",
            "t.lua:1: surface.positions[2] = {1, 0} and positions[3] = {1.5, 0.1, 0.25} overlap by 0.377 u: "
            "must not overlap with tops of 0.8 × 0.8 u"},
        Mistake{"surface{rows = 2, columns = 1, layout = 'hex', actuator = pin{top = 1}}",
                "t.lua:1: surface.cell (1, 1) and cell (2, 1) overlap by 0.134 u: "
                "must not overlap with tops of 1 × 1 u"},
        Mistake{"surface{actuator = pin{max_force = 2e12}}",
                "t.lua:1: pin.max_force = 2e+12: must be in (0, 1e+12]"},
        Mistake{"surface{actuator = pin{max_force = 0}}",
                "t.lua:1: pin.max_force = 0: must be greater than 0"},
        Mistake{"surface{positions = {{0, 0}, {1}}}",
                "t.lua:1: surface.positions[2] = a table of 1 values: must be {x, y} or {x, y, angle}"},
        Mistake{
            "surface{modules = {size = {4, 4}, map = {'#', '##'}}}",
            "t.lua:1: surface.modules.map = a table: must be a list of strings, one character per module, "
            "'.' for none"},
        Mistake{"surface{rows = 5, modules = {size = {4, 4}, map = {'#'}}}",
                "t.lua:1: surface.modules: the modules have 4 rows and 4 columns together; leave out "
                "surface.rows and "
                "surface.columns"},
        Mistake{"surface{rows = 2, columns = 1, base = {{0}}}", "t.lua:1: surface.base: 1 rows: must be 2"},
        Mistake{"surface{rows = 1, columns = 1, base = function() return 0/0 end}",
                "t.lua:1: surface.base at (1, 1) = nan: must be finite"},
        Mistake{"surface{tilt = {100, 0}}", "t.lua:1: surface.tilt: 100 degrees: must be in [-90, 90]"},
        Mistake{"faults{actuator = {stuck = 2}}", "t.lua:1: faults.actuator.stuck = 2: must be in [0, 1]"},
        Mistake{"faults{actuator = {stuck = 0.6, dead = 0.6}}",
                "t.lua:1: faults.actuator: stuck, dead and weak add up to 1.2 of the cells: must be at "
                "most 1"},
        Mistake{"faults{actuator = {weak = {gain = 0.5}}}",
                "t.lua:1: faults.actuator.weak: the field 'fraction' is missing"},
        Mistake{"sphere{radius = 1, position = {0, 0, 0}, moment = 1}",
                "t.lua:1: sphere.moment = 1: must be three numbers {x, y, z}"}));

TEST_F(ErrorTest, MissingFileAndFolder) {
  EXPECT_EQ(caught([&] { Experiment::load(folder / "none.lua"); }),
            "none.lua: the experiment does not exist");
  std::filesystem::create_directory(folder / "f.lua");
  EXPECT_EQ(caught([&] { Experiment::load(folder / "f.lua"); }), "f.lua: the experiment is a folder");
}

TEST_F(ErrorTest, DoesNotTruncateLongPath) {
  const std::string name = std::string(90, 'n') + ".lua";
  EXPECT_EQ(caught([&] { Experiment::load(write(name, "\nlocal x = nil + 1")); }),
            name + ":2: attempt to perform arithmetic on a nil value");
  EXPECT_EQ(caught([&] { Experiment::load(write(name, "\n\nx = = 1")); }),
            name + ":3: unexpected symbol near '='");
}

TEST_F(ErrorTest, InvalidOptions) {
  const std::string text = "surface{}\noption('count', 40)\noption('big', true)";
  options.overrides = {{"count", "many"}};
  EXPECT_EQ(error_of(text), "t.lua:2: option 'count': --set count=many: must be a number (default 40)");
  options.overrides = {{"count", "nan"}};
  EXPECT_EQ(error_of(text), "t.lua:2: option 'count': --set count=nan: must be a number (default 40)");
  options.overrides = {{"count", "3 "}};
  EXPECT_EQ(error_of(text), "t.lua:2: option 'count': --set count=3 : must be a number (default 40)");
  options.overrides = {{"big", "maybe"}};
  EXPECT_EQ(error_of(text), "t.lua:3: option 'big': --set big=maybe: must be true or false (default true)");
  options.overrides = {{"cuont", "3"}};
  EXPECT_EQ(
      error_of(text),
      "t.lua: --set cuont=3: the script has no option 'cuont' (did you mean 'count'?); options: count=40, "
      "big=true");
  EXPECT_EQ(error_of("surface{}"), "t.lua: --set cuont=3: the script has no option 'cuont'; options: none");
}

TEST_F(ErrorTest, RunTimeErrors) {
  EXPECT_EQ(run_error_of("local x = nil\nx()"), "t.lua:3: attempt to call a nil value (local 'x')");
  EXPECT_EQ(run_error_of("world{}"),
            "t.lua:2: world: only while the script loads, outside at, every, on_tick and on_finish");
  EXPECT_EQ(run_error_of("sphere{radius = 0/0, position = {0, 0, 9}}"),
            "t.lua:2: sphere.radius = nan: must be finite");
  EXPECT_EQ(run_error_of("object(5):position()"),
            "t.lua:2: object:position: there is no object 5 (removed, or never created)");
  EXPECT_EQ(run_error_of("object('a')"),
            "t.lua:2: object: id = 'a': must be an integer from 0 to 4294967295");
  EXPECT_EQ(run_error_of("object(0):postion()"),
            "t.lua:2: object: has no 'postion' (did you mean 'position'?)");
  EXPECT_EQ(run_error_of("object(0).alive()"),
            "t.lua:2: object:alive: call it with a colon, object(id):alive");
  EXPECT_EQ(run_error_of("local o = object(sphere{radius = 1, position = {0, 0, 9}}) o:push{seconds = 1}"),
            "t.lua:2: push: the field 'force' is missing");
  EXPECT_EQ(run_error_of("local o = object(sphere{radius = 1, position = {0, 0, 9}}) o:push{1, 2}"),
            "t.lua:2: push.force = a table of 2 values: must be three numbers {x, y, z}");
  EXPECT_EQ(
      run_error_of("local o = object(sphere{radius = 1, position = {0, 0, 9}}) o:push{1, 2, 3, seconds = 1}"),
      "t.lua:2: push: a value without a field name; known: force, point, seconds");
  EXPECT_EQ(run_error_of("local o = object(sphere{radius = 1, position = {0, 0, 9}}) o:teleport{}"),
            "t.lua:2: teleport: needs position, orientation, velocity or angular_velocity");
  const std::string fixed = "local o = object(sphere{radius = 1, position = {0, 0, 9}, fixed = true}) ";
  for (const std::string field : {"velocity", "angular_velocity"})
    EXPECT_EQ(run_error_of(fixed + "o:teleport{" + field + " = {0, 0, 1}}"),
              "t.lua:2: teleport." + field +
                  ": a fixed object stands still: must be {0, 0, 0}; its position can be set");
  EXPECT_EQ(run_error_of(fixed + "o:teleport{position = {1, 1, 9}, velocity = {0, 0, 0}} error('done')"),
            "t.lua:2: done");
  EXPECT_EQ(run_error_of("cells:target('heigth', 1, 1, 2)"),
            "t.lua:2: cells:target: no channel 'heigth' (did you mean 'height'?)");
  EXPECT_EQ(run_error_of("cells:target('height', 0, 1, 2)"),
            "t.lua:2: cells:target: row = 0: must be an integer from 1 to 4");
  EXPECT_EQ(run_error_of("cells:target('height', 1, 7, 2)"),
            "t.lua:2: cells:target: column = 7: must be an integer from 1 to 6");
  EXPECT_EQ(run_error_of("cells:target('height', 1, 1, 0/0)"),
            "t.lua:2: cells:target: value = nan: must be finite");
  EXPECT_EQ(run_error_of("cells:targets('height', {1, 2})"),
            "t.lua:2: cells:targets: values: a list of 2 values: must be 24");
  EXPECT_EQ(run_error_of("cells:targets('height', {{1, 2}, {}, {}, {}})"),
            "t.lua:2: cells:targets: values[1]: a list of 2 values: must be 6");
  EXPECT_EQ(run_error_of("cells:sense('presure', 1, 1)"),
            "t.lua:2: cells:sense: no channel 'presure'; known: proximity, proximity_hit");
  EXPECT_EQ(run_error_of("at(-1, print)"), "t.lua:2: at: seconds = -1: must be from 0 to 1e9");
}

TEST_F(ErrorTest, SimulationInputErrorHasScriptLocation) {
  Experiment e = load_on_surface("at(0, function()\ncells:target('height', 1, 1, 2) end)");
  FakeSimulation simulation(e.scene());
  simulation.controller_attached = true;
  e.start(simulation);
  EXPECT_EQ(caught([&] { e.tick(0.0, 0); }),
            "t.lua:3: cells:target: a controller is attached and sets the targets");
}

TEST_F(ErrorTest, OtherSimulationExceptionsPassThrough) {
  Experiment e = load_on_surface("at(0, function() pcall(pause) end)");
  FakeSimulation simulation(e.scene());
  simulation.broken = true;
  e.start(simulation);
  EXPECT_THROW(
      {
        try {
          e.tick(0.0, 0);
        } catch (const std::runtime_error& failure) {
          EXPECT_STREQ(failure.what(), "simulated failure");
          EXPECT_EQ(dynamic_cast<const scene::InputError*>(&failure), nullptr);
          throw;
        }
      },
      std::runtime_error);
}

TEST_F(ErrorTest, LibraryCallbackReportsRegistrationLine) {
  Experiment e = load_on_surface("\nat(0, sphere)");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  EXPECT_EQ(caught([&] { e.tick(0.0, 0); }),
            "t.lua:3: sphere: takes a table of fields, sphere{radius = ...}, not 0");
}

TEST_F(ErrorTest, FinishRunsAfterError) {
  Experiment e = load_on_surface("on_finish(function() print('end') end) on_tick(function() error('x') end)");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  EXPECT_EQ(caught([&] { e.tick(0.0, 0); }), "t.lua:2: x");
  e.finish();
  e.finish();
  EXPECT_EQ(printed, "end\n");
}

TEST_F(ErrorTest, PcallCatchesScriptError) {
  load_on_surface("print(pcall(sphere, {radius = -1, position = {0, 0, 0}}))");
  EXPECT_NE(printed.find("t.lua:2: sphere.radius = -1: must be in"), std::string::npos) << printed;
}

}  // namespace
}  // namespace smartsurf::script
