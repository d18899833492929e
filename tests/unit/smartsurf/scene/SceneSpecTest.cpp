#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/SceneSpec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace smartsurf::scene {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(WorldSpec, StepsPerTick) {
  WorldSpec w;
  EXPECT_EQ(w.steps_per_tick(), 4);
  w.dt_s = w.control_period_s = 0.01;
  EXPECT_EQ(w.steps_per_tick(), 1);
}

TEST(WorldSpec, ErrorsNameTheField) {
  WorldSpec w;
  EXPECT_EQ(validate(w), "");
  w.gravity.y() = kNan;
  EXPECT_EQ(validate(w), "world.gravity[2] = nan: must be in [-1000000, 1000000]");
  w = {};
  w.dt_s = -0.5;
  EXPECT_EQ(validate(w), "world.dt = -0.5: must be in [1e-05, 0.1] seconds");
  w = {};
  w.dt_s = 0.01;
  w.control_period_s = 0.015;
  EXPECT_EQ(validate(w),
            "world.control_period = 0.015: must be an integer number of physics steps, world.dt = 0.01");
}

TEST(SurfaceSpec, IndexAndCentreFollowConvention) {
  SurfaceSpec s;
  s.rows = 3;
  s.columns = 5;
  s.pitch = 2.0;
  EXPECT_EQ(s.cell_count(), 15);
  EXPECT_EQ(s.index(1, 2), 7);
  EXPECT_EQ(s.centre(2, 0), Eigen::Vector2d(0, 0));  // the south-west cell is the origin
  EXPECT_EQ(s.centre(0, 4), Eigen::Vector2d(8, 4));
  EXPECT_TRUE(s.is_border(0, 2) && s.is_border(2, 2) && s.is_border(1, 0) && s.is_border(1, 4));
  EXPECT_FALSE(s.is_border(1, 2));
}

// The base raises the pins once, whether the surface names them or not, however often `pin` is derived.
TEST(SurfaceSpec, BaseRaisesNoChannel) {
  for (const bool named : {false, true}) {
    SurfaceSpec s;
    s.rows = 1, s.columns = 2;
    s.base_heights = {-1.0F, 2.5F};
    if (named) s.actuators = {make_pin_actuator({})};
    for (int times = 0; times < 3; ++times) {
      derive_pin_spec(s);
      EXPECT_EQ(s.pin.min_height, -1.0);
      EXPECT_EQ(s.pin.max_height, 8.5);
      EXPECT_EQ(s.effective_actuators()[0].numbers("range"), (std::vector<double>{0, 6}));
      const ActuatorChannel height = s.actuator_channels().at(0);
      EXPECT_EQ(height.minimum, 0.0);
      EXPECT_EQ(height.maximum, 6.0);
      EXPECT_EQ(height.safe_value, 0.0);
    }
  }
}

TEST(SurfaceSpec, ErrorsNameTheField) {
  SurfaceSpec s;
  EXPECT_EQ(validate(s), "");
  s.pin.top_x = 1.5;
  EXPECT_EQ(validate(s), "pin.top[1] = 1.5: must be in [0.001, pitch], the pitch is 1");
  s = {};
  s.pin.max_height = kInfinity;
  EXPECT_EQ(validate(s), "pin.range[2] = inf: must be in [-1000000, 1000000]");
  s = {};
  s.columns = 5000;
  EXPECT_EQ(validate(s), "surface.columns = 5000: must be 1 to 4096");
  s = {};
  s.sensors.push_back(find_sensor_kind("proximity")->default_spec());
  s.sensors[0].values["range"] = {-1.0};
  EXPECT_EQ(validate(s), "proximity.range = -1: must be greater than 0");
  s = {};
  s.border_height = kNan;
  EXPECT_EQ(validate(s), "border.height = nan: must be in [-1000000, 1000000]");
}

TEST(SurfaceSpec, ChannelNamesMustBeUnique) {
  SurfaceSpec s;
  const SensorSpec proximity = find_sensor_kind("proximity")->default_spec();
  s.sensors = {proximity, proximity};
  s.sensors[0].name = "a";
  s.sensors[1].name = "b";
  EXPECT_EQ(s.sensor_channels(), (std::vector<std::string>{"a", "a_hit", "b", "b_hit"}));
  EXPECT_EQ(validate(s), "");
  s.sensors[1].name = "a";
  EXPECT_EQ(validate(s), "surface.sensors: two channels are called 'a': give a sensor another name");
  s.sensors[1].name = "b c";
  EXPECT_EQ(
      validate(s),
      "surface.sensors: channel 'b c': must be 1 to 31 letters, digits, '_', '.' and '-', not a dot first");
  s.sensors.assign(16, proximity);
  EXPECT_EQ(validate(s),
            "surface.sensors: 32 sensor channels beside 1 of actuators: must be at most 32 together");
}

TEST(Material, ErrorsNameTheField) {
  Material m;
  EXPECT_EQ(validate(m), "");
  m.friction = kNan;
  EXPECT_EQ(validate(m), "material.friction = nan: must be in [0, 1000000]");
  m = {};
  m.density = 0.0;
  EXPECT_EQ(validate(m), "material.density = 0: must be in [1e-09, 1000000]");
  m = {};
  m.name = "";
  EXPECT_EQ(validate(m), "material.name is missing");
}

TEST(ObjectSpec, VolumesAndExtents) {
  ObjectSpec o;
  o.radius = 2.0;
  EXPECT_DOUBLE_EQ(o.volume(), 32.0 / 3.0 * std::numbers::pi);
  EXPECT_EQ(o.half_extents(), Eigen::Vector3d(2, 2, 2));
  o.shape = ShapeKind::kCylinder;
  o.height = 3.0;
  EXPECT_DOUBLE_EQ(o.volume(), 12.0 * std::numbers::pi);
  EXPECT_EQ(o.half_extents(), Eigen::Vector3d(2, 2, 1.5));
  o.shape = ShapeKind::kBox;
  o.size = {1, 2, 3};
  EXPECT_DOUBLE_EQ(o.volume(), 6.0);
  EXPECT_EQ(o.half_extents(), Eigen::Vector3d(0.5, 1, 1.5));
}

TEST(ObjectSpec, ErrorsNameTheField) {
  ObjectSpec o;
  EXPECT_EQ(validate(o), "");
  o.radius = kNan;
  EXPECT_EQ(validate(o), "radius = nan: must be in [0.001, 1000000]");
  o = {};
  o.position.z() = -kInfinity;
  EXPECT_EQ(validate(o), "position[3] = -inf: must be in [-1000000, 1000000]");
  o = {};
  o.orientation.coeffs().setZero();
  EXPECT_EQ(validate(o), "orientation: must be a rotation");
  o = {};
  o.mass = -1.0;
  EXPECT_EQ(validate(o), "mass = -1: must be in [1e-09, 1e+12]");
  o = {};
  o.shape = ShapeKind::kBox;
  o.size.x() = 0.0;
  EXPECT_EQ(validate(o), "size[1] = 0: must be in [0.001, 1000000]");
}

}  // namespace
}  // namespace smartsurf::scene
