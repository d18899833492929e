// Tests the declarations of actuators and surface layouts.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/smartsurf/script/ScriptFixture.h"

namespace smartsurf::script {
namespace {

using LayoutTest = ScriptTest;

std::vector<int> models(const scene::SurfaceSpec& s) {
  return {s.actuator_of_cell.begin(), s.actuator_of_cell.end()};
}

TEST_F(LayoutTest, ActuatorDefinesChannelsAndBody) {
  const Experiment e =
      load("surface{actuator = wheels{top = 0.9, radius = 0.2, max_spin = 12, latency = 2}}");
  const scene::SurfaceSpec& s = e.scene().surface;
  EXPECT_EQ(s.pin.top_x, 0.9);
  EXPECT_EQ(s.pin.max_height, 0.0);
  ASSERT_EQ(s.actuators.size(), 1u);
  EXPECT_EQ(s.actuators[0].number("latency"), 2.0);
  const auto channels = s.actuator_channels();
  ASSERT_EQ(channels.size(), 2u);
  EXPECT_EQ(channels[1].name, "spin_b");
  EXPECT_EQ(channels[1].unit, "rad/s");
  EXPECT_EQ(channels[1].minimum, -12.0);
  EXPECT_EQ(channels[1].maximum, 12.0);
}

TEST_F(LayoutTest, PatternRepeatsAndLeavesCellsEmpty) {
  const Experiment e =
      load("surface{rows = 2, columns = 6, actuators = {p = pin{}, w = wheels{}}, cells = {'pw.'}}");
  EXPECT_EQ(models(e.scene().surface), (std::vector<int>{0, 1, -1, 0, 1, -1, 0, 1, -1, 0, 1, -1}));
}

TEST_F(LayoutTest, FunctionReturnsIndexOrNil) {
  const Experiment e = load(
      "surface{rows = 2, columns = 2, actuators = {pin{}, ball{}}, "
      "cells = function(r, c) if r == 1 then return c end end}");
  EXPECT_EQ(models(e.scene().surface), (std::vector<int>{0, 1, -1, -1}));
}

TEST_F(LayoutTest, MaskRemovesCells) {
  const Experiment e = load("surface{rows = 2, columns = 2, mask = {{true, false}, {true, true}}}");
  EXPECT_EQ(models(e.scene().surface), (std::vector<int>{0, -1, 0, 0}));
  EXPECT_TRUE(e.scene().surface.is_empty(0, 1));
}

TEST_F(LayoutTest, HexCellsHaveSixNeighboursAtPitch) {
  const Experiment e = load("surface{rows = 5, columns = 5, pitch = 2, layout = 'hex'}");
  const scene::SurfaceSpec& s = e.scene().surface;
  EXPECT_EQ(s.centre(4, 0), Eigen::Vector2d(0, 0));
  int near = 0;
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 5; ++c) near += std::abs((s.centre(r, c) - s.centre(2, 2)).norm() - 2) < 1e-9;
  EXPECT_EQ(near, 6);
}

TEST_F(LayoutTest, ForceLimitsReachFarAboveAMillion) {
  for (const char* const actuator : {"pin", "force_field"}) {
    const Experiment e = load(std::string("surface{actuator = ") + actuator + "{max_force = 1e12}}");
    EXPECT_EQ(e.scene().surface.actuators[0].number("max_force"), 1e12);
  }
}

TEST_F(LayoutTest, MissingPositionsAreEmptyCells) {
  const Experiment e = load("surface{rows = 2, columns = 2, positions = {{0, 0}, {3, 1, 0.5}, false}}");
  const scene::SurfaceSpec& s = e.scene().surface;
  EXPECT_EQ(models(s), (std::vector<int>{0, 0, -1, -1}));
  EXPECT_EQ(s.centre(0, 1), Eigen::Vector2d(3, 1));
  EXPECT_EQ(s.cell_poses[1].angle, 0.5);
  const Experiment row = load("surface{positions = {{0, 0}, {x = 3, y = 1}}}");
  EXPECT_EQ(row.scene().surface.rows, 1);
  EXPECT_EQ(row.scene().surface.columns, 2);
}

TEST_F(LayoutTest, ModulesWithGaps) {
  const Experiment e = load(
      "surface{actuators = {a = pin{}, b = ball{}}, "
      "modules = {size = {1, 2}, gap = 0.5, map = {'ab', '.#'}}}");
  const scene::SurfaceSpec& s = e.scene().surface;
  EXPECT_EQ(s.rows, 2);
  EXPECT_EQ(s.columns, 4);
  EXPECT_EQ(models(s), (std::vector<int>{0, 0, 1, 1, -1, -1, 0, 0}));
  EXPECT_EQ(s.centre(1, 0), Eigen::Vector2d(0, 0));
  EXPECT_EQ(s.centre(0, 2), Eigen::Vector2d(2.5, 1.5));
}

TEST_F(LayoutTest, BaseRaisesCellsAndTiltRotatesGravity) {
  const Experiment e =
      load("surface{rows = 1, columns = 3, base = function(r, c) return c / 2 end, tilt = {30, 0}}");
  EXPECT_EQ(e.scene().surface.base_heights, (std::vector<float>{0.5F, 1.0F, 1.5F}));
  EXPECT_EQ(e.scene().surface.pin.max_height, 7.5);
  EXPECT_EQ(e.scene().surface.pin.min_height, 0.5);
  const Eigen::Vector3d& g = e.scene().world.gravity;
  EXPECT_NEAR(g.y(), -9.81 / 2, 1e-9) << "the north edge is raised, so objects slide south";
  EXPECT_NEAR(g.z(), -9.81 * std::cos(std::numbers::pi / 6), 1e-9);
}

TEST_F(LayoutTest, ReadsFaultsAndMagneticProperties) {
  write("faults.csv", "row,column,channel,fault,value\n0,0,height,dead,\n");
  const Experiment e = load(R"(
    surface{}
    faults{actuator = {stuck = 0.02, dead = 0.01, weak = {fraction = 0.05, gain = 0.5}, latency = 2}, map = 'faults.csv'}
    box{size = {1, 1, 1}, position = {0, 0, 0}, pole = -2, moment = {0, 0, 3}})");
  const scene::FaultSpec& f = e.scene().surface.faults;
  EXPECT_EQ(f.actuator.stuck_fraction, 0.02);
  EXPECT_EQ(f.actuator.weak_gain, 0.5);
  EXPECT_EQ(f.actuator.latency_ticks, 2);
  ASSERT_TRUE(f.fault_map.has_value());
  EXPECT_EQ(e.scene().objects[0].magnetic_pole, -2.0);
  EXPECT_EQ(e.scene().objects[0].magnetic_moment.z(), 3.0);
}

}  // namespace
}  // namespace smartsurf::script
