#include <cmath>
#include <numbers>

#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

using DeclarationTest = ScriptTest;

TEST_F(DeclarationTest, WorldReadsAllFields) {
  const Experiment e = load_on_surface(
      "world{gravity = -3, dt = 1/120, iterations = 20, control_period = 1/30, seed = 7, ground = false, "
      "sleep = false}");
  const scene::WorldSpec& w = e.scene().world;
  EXPECT_EQ(w.gravity, Eigen::Vector3d(0, 0, -3));
  EXPECT_DOUBLE_EQ(w.dt_s, 1.0 / 120.0);
  EXPECT_EQ(w.iterations, 20);
  EXPECT_DOUBLE_EQ(w.control_period_s, 1.0 / 30.0);
  EXPECT_EQ(w.seed, 7u);
  EXPECT_FALSE(w.ground);
  EXPECT_FALSE(w.sleep);
  EXPECT_EQ(w.steps_per_tick(), 4);
}

TEST_F(DeclarationTest, GravityAcceptsVector) {
  EXPECT_EQ(load_on_surface("world{gravity = {1, -2, 3.5}}").scene().world.gravity,
            Eigen::Vector3d(1, -2, 3.5));
}

TEST_F(DeclarationTest, UnitSetsGravity) {
  EXPECT_FALSE(load_on_surface("").scene().world.unit);
  const scene::WorldSpec w = load_on_surface("world{unit = 'mm'}").scene().world;
  EXPECT_DOUBLE_EQ(w.unit->metres, 0.001);
  EXPECT_NEAR(w.gravity.z(), -9810, 1e-9);
  EXPECT_EQ(load_on_surface("world{gravity = -3, unit = 'in'}").scene().world.gravity,
            Eigen::Vector3d(0, 0, -3));
  EXPECT_EQ(error_of("world{unit = 'km'}"), "t.lua:1: world.unit = 'km': must be 'mm', 'cm', 'in' or 'm'");
}

TEST_F(DeclarationTest, CaseStudySurface) {
  const Experiment e = load(R"(
    material{name = 'plastic', friction = 0.4, rolling_friction = 0.02, restitution = 0.3, density = 2}
    surface{rows = 64, columns = 32, pitch = 1.5,
            actuator = pin{top = {0.8, 0.7}, length = 3, range = {-1, 5}, max_speed = 10, max_acceleration = 200},
            sensors = {proximity{range = 6}, proximity{name = 'far', range = 20}},
            border = {height = 6}, material = 'plastic'}
    record{objects = false, sensors = true, actuators = true, every = 4})");
  const scene::SurfaceSpec& s = e.scene().surface;
  EXPECT_EQ(s.rows, 64);
  EXPECT_EQ(s.columns, 32);
  EXPECT_EQ(s.pitch, 1.5);
  EXPECT_EQ(s.pin.top_x, 0.8);
  EXPECT_EQ(s.pin.top_y, 0.7);
  EXPECT_EQ(s.pin.length, 3.0);
  EXPECT_EQ(s.pin.min_height, -1.0);
  EXPECT_EQ(s.pin.max_height, 5.0);
  EXPECT_EQ(s.pin.max_speed, 10.0);
  EXPECT_EQ(s.pin.max_acceleration, 200.0);
  ASSERT_EQ(s.sensors.size(), 2u);
  EXPECT_EQ(s.sensors[0].name, "proximity");
  EXPECT_EQ(s.sensors[0].number("range"), 6.0);
  EXPECT_EQ(s.sensors[1].name, "far");
  EXPECT_EQ(s.sensors[1].number("range"), 20.0);
  EXPECT_EQ(s.border_height, 6.0);
  ASSERT_EQ(s.material, 1);
  const scene::Material& m = e.scene().materials[1];
  EXPECT_EQ(m.name, "plastic");
  EXPECT_EQ(m.friction, 0.4);
  EXPECT_EQ(m.rolling_friction, 0.02);
  EXPECT_EQ(m.restitution, 0.3);
  EXPECT_EQ(m.density, 2.0);
  const scene::RecordSpec& r = e.scene().record;
  EXPECT_FALSE(r.objects);
  EXPECT_EQ(r.sensors, scene::SensorRecording::kAlways);
  EXPECT_TRUE(r.actuators);
  EXPECT_EQ(r.tick_interval, 4);
}

TEST_F(DeclarationTest, AbsentFieldsKeepDefaults) {
  const scene::SceneSpec spec = load("surface{}").scene(), fresh;
  EXPECT_EQ(spec.surface.rows, fresh.surface.rows);
  EXPECT_EQ(spec.surface.pin.top_x, fresh.surface.pin.top_x);
  EXPECT_TRUE(spec.surface.sensors.empty());
  EXPECT_FALSE(spec.surface.border_height);
  EXPECT_EQ(spec.world.gravity, fresh.world.gravity);
  EXPECT_EQ(spec.world.seed, 1u);
  EXPECT_TRUE(spec.record.objects);
  EXPECT_EQ(spec.record.sensors, scene::SensorRecording::kWhereCheap);
  EXPECT_EQ(load("surface{} record{sensors = false}").scene().record.sensors, scene::SensorRecording::kNever);
  EXPECT_EQ(load("surface{} record{sensors = true}").scene().record.sensors, scene::SensorRecording::kAlways);
  EXPECT_EQ(spec.materials.size(), 1u);
}

TEST_F(DeclarationTest, ChannelLimits) {
  const std::string name(27, 'n');
  EXPECT_EQ(
      load("surface{sensors = {proximity{name = '" + name + "'}}}").scene().surface.sensor_channels()[1],
      name + "_hit");
  load("local s = {} for i = 1, 15 do s[i] = proximity{name = 's' .. i} end surface{sensors = s}");
  EXPECT_EQ(
      error_of("local s = {} for i = 1, 16 do s[i] = proximity{name = 's' .. i} end surface{sensors = s}"),
      "t.lua:1: surface.sensors: 32 sensor channels beside 1 of actuators: must be at most 32 together");
  EXPECT_EQ(
      error_of("local s = {} for i = 1, 33 do s[i] = pressure{name = 's' .. i} end surface{sensors = s}"),
      "t.lua:1: surface.sensors: more than 32 sensors");
  EXPECT_EQ(error_of("surface{sensors = {proximity{}, proximity{name = 'proximity_hit'}}}"),
            "t.lua:1: surface.sensors: two channels are called 'proximity_hit': give a sensor another name");
}

TEST_F(DeclarationTest, DefaultTopFitsPitch) {
  const auto top = [&](const char* text) { return load(text).scene().surface.pin.top_x; };
  EXPECT_EQ(top("surface{rows = 2, columns = 2, pitch = 0.5}"), 0.4);
  EXPECT_EQ(top("surface{rows = 2, columns = 2, pitch = 0.5, actuator = ball{}}"), 0.4);
  EXPECT_EQ(top("surface{rows = 2, columns = 2, pitch = 2, actuator = ball{}}"), 1.6);
  EXPECT_EQ(top("surface{rows = 2, columns = 2, pitch = 2, actuators = {p = pin{}, b = ball{top = 1.5}}, "
                "cells = {'pb'}}"),
            1.5);
}

TEST_F(DeclarationTest, AcceptsScalarTopAndSingleSensor) {
  const Experiment e = load("surface{actuator = pin{top = 0.5}, sensors = proximity{}}");
  EXPECT_EQ(e.scene().surface.pin.top_x, 0.5);
  EXPECT_EQ(e.scene().surface.pin.top_y, 0.5);
  EXPECT_EQ(e.scene().surface.sensors.size(), 1u);
}

TEST_F(DeclarationTest, RedefinesDefaultMaterial) {
  const Experiment e = load_on_surface("material{name = 'default', friction = 0.9}");
  ASSERT_EQ(e.scene().materials.size(), 1u);
  EXPECT_EQ(e.scene().materials[0].friction, 0.9);
}

TEST_F(DeclarationTest, NamesAreComparedAsAWhole) {
  const std::string start(100, 'm');
  const std::string both =
      "material{name = '" + start + "a'}\nmaterial{name = '" + start + "b', friction = 0.9}\n";
  EXPECT_EQ(load_on_surface(both).scene().materials.size(), 3u);
  EXPECT_EQ(error_of(both + "material{name = '" + start + "b'}"),
            "t.lua:3: material '" + std::string(60, 'm') + "': already declared at t.lua:2");
}

TEST_F(DeclarationTest, AllShapesAndFields) {
  const Experiment e = load_on_surface(R"(
    material{name = 'steel', density = 7.8}
    local a = sphere{radius = 2, position = {10, 11, 8}, material = 'steel', colour = 'red', label = 'small',
                     velocity = {1, 2, 3}, angular_velocity = {4, 5, 6}, mass = 3}
    local b = box{size = {1, 2, 3}, position = {x = 1, y = 2, z = 3}, colour = '#ff8000', fixed = true}
    local c = cylinder{radius = 1, height = 4, position = {0, 0, 0}, colour = {0.25, 0.5, 1}}
    assert(a == 0 and b == 1 and c == 2))");
  const auto& objects = e.scene().objects;
  ASSERT_EQ(objects.size(), 3u);
  const scene::ObjectSpec& a = objects[0];
  EXPECT_EQ(a.shape, scene::ShapeKind::kSphere);
  EXPECT_EQ(a.radius, 2.0);
  EXPECT_EQ(a.position, Eigen::Vector3d(10, 11, 8));
  EXPECT_EQ(a.velocity, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(a.angular_velocity, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(a.mass, 3.0);
  EXPECT_EQ(a.material, 1);
  EXPECT_EQ(a.label, "small");
  EXPECT_FALSE(a.fixed);
  EXPECT_GT(a.colour.r, 2 * a.colour.g);
  const scene::ObjectSpec& b = objects[1];
  EXPECT_EQ(b.shape, scene::ShapeKind::kBox);
  EXPECT_EQ(b.size, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(b.position, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(b.fixed);
  EXPECT_FALSE(b.mass);
  EXPECT_FLOAT_EQ(b.colour.r, 1.0f);
  EXPECT_FLOAT_EQ(b.colour.g, 128.0f / 255.0f);
  EXPECT_FLOAT_EQ(b.colour.b, 0.0f);
  const scene::ObjectSpec& c = objects[2];
  EXPECT_EQ(c.shape, scene::ShapeKind::kCylinder);
  EXPECT_EQ(c.height, 4.0);
  EXPECT_EQ(c.colour.b, 1.0f);
}

TEST_F(DeclarationTest, OrientationForms) {
  const Experiment e = load_on_surface(R"(
    local function b(o) box{size = {1, 1, 1}, position = {0, 0, 0}, orientation = o} end
    local h = math.sin(math.pi / 4)
    b{x = 0, y = 0, z = h, w = h}
    b{0, 0, 2 * h, 2 * h}
    b{axis = {0, 0, 5}, angle = math.pi / 2}
    b{yaw = math.pi / 2}
    b{roll = math.pi / 2, yaw = math.pi / 2})");
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  ASSERT_EQ(e.scene().objects.size(), 5u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT(e.scene().objects[i].orientation.angularDistance(quarter), 1e-12) << i;
    EXPECT_NEAR(e.scene().objects[i].orientation.norm(), 1.0, 1e-12);
  }
  // Roll about x maps y to z; the following yaw about z leaves it there.
  const Eigen::Vector3d y = e.scene().objects[4].orientation * Eigen::Vector3d::UnitY();
  EXPECT_LT((y - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

TEST_F(DeclarationTest, KeepsFileNameAndSource) {
  const std::string text = "surface{}\n-- the end\n";
  const Experiment e = load(text);
  EXPECT_EQ(e.scene().file, (folder / "t.lua").string());
  EXPECT_EQ(e.scene().source, text);
}

TEST_F(DeclarationTest, SkipsShebangAndByteOrderMark) {
  EXPECT_EQ(error_of("\xef\xbb\xbf#!/usr/bin/env smartsurf\nsphere{}"),
            "t.lua:2: sphere: the field 'radius' is missing");
}

TEST_F(DeclarationTest, OptionsKeepTypeAndOrder) {
  const std::string text = R"(surface{}
    local n = option('count', 40, 'number of spheres')
    local v = option('speed', 1.5)
    local s = option('name', 'sort', 'a text')
    local b = option('big', false)
    print(math.type(n), n, math.type(v), v, s, b))";
  load(text);
  EXPECT_EQ(printed, "integer\t40\tfloat\t1.5\tsort\tfalse\n");
  printed.clear();
  options.overrides = {{"count", "7"}, {"speed", "2"}, {"name", "12"}, {"big", "true"}, {"count", "8"}};
  const Experiment e = load(text);
  EXPECT_EQ(printed, "integer\t8\tfloat\t2.0\t12\ttrue\n");
  ASSERT_EQ(e.scene().options.size(), 4u);
  EXPECT_EQ(e.scene().options[0].name, "count");
  EXPECT_EQ(e.scene().options[0].value, "8");
  EXPECT_EQ(e.scene().options[0].help, "number of spheres");
  EXPECT_EQ(e.scene().options[1].name, "speed");
  EXPECT_EQ(e.scene().options[1].value, "2.0");
  EXPECT_EQ(e.scene().options[3].value, "true");
}

TEST_F(DeclarationTest, OptionsKeepKindRangeAndChoices) {
  using Kind = scene::OptionSpec::Kind;
  const std::string text = R"(surface{}
    option('count', 40, 'number', {4, 64})
    option('speed', 1.5, nil, {0, 2})
    option('kind', 'ball', 'what', {'ball', 'box'})
    option('code', '12')
    option('big', false))";
  const std::vector<scene::OptionSpec> declared = load(text).scene().options;
  EXPECT_EQ(declared[0].kind, Kind::kInteger);
  EXPECT_EQ(declared[0].range, (std::array{4.0, 64.0}));
  EXPECT_EQ(declared[0].help, "number; 4 to 64");
  EXPECT_EQ(declared[1].kind, Kind::kReal);
  EXPECT_EQ(declared[1].range, (std::array{0.0, 2.0}));
  EXPECT_EQ(declared[2].kind, Kind::kText);
  EXPECT_EQ(declared[2].choices, (std::vector<std::string>{"ball", "box"}));
  EXPECT_FALSE(declared[2].range);
  EXPECT_EQ(declared[3].kind, Kind::kText) << "a text of digits";
  EXPECT_EQ(declared[4].kind, Kind::kBool);
  options.overrides = {{"count", "8.0"}};
  EXPECT_EQ(load(text).scene().options[0].value, "8");
  options.overrides = {{"n", "2.5"}};
  EXPECT_EQ(load("surface{} option('n', 2)").scene().options[0].kind, Kind::kReal);
}

TEST_F(DeclarationTest, CellsExposeSurfaceProperties) {
  load_on_surface("print(cells.rows, cells.columns, cells.pitch, cells:centre(1, 2), cells:centre(4, 1))");
  EXPECT_EQ(printed, "4\t6\t1.0\t1.0\t0.0\t0.0\n");
}

}  // namespace
}  // namespace smartsurf::script
