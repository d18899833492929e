#include "smartsurf/view/model/ActuatorGeometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/smartsurf/view/Scenes.h"

namespace smartsurf::view {
namespace {

// 3 × 3 cells of one mechanism, which look as `motion` says.
struct Bench {
  Bench(const std::string& model, const scene::ActuatorState& motion,
        const scene::ParameterValues& values = {})
      : scene(3, 3, 1.0F) {
    scene::ActuatorSpec spec = scene::find_actuator_kind(model)->default_spec();
    for (const auto& [name, value] : values) spec.values[name] = value;
    scene.spec.surface.actuators = {spec};
    derive_pin_spec(scene.spec.surface);
    scene.snapshot.actuator_state.assign(9, motion);
  }
  ActuatorGeometry parts() {
    ActuatorGeometry made(scene.spec.surface);
    made.update(scene.snapshot);
    return made;
  }
  Scene scene;
};

Eigen::Vector3f vec(const std::array<float, 3>& a) { return Eigen::Vector3f(a.data()); }

// Of the mesh's corners, where the highest stands.
float top_of(const InstancedMesh& kind, const MeshInstance& p) {
  float top = -1e9F;
  for (std::size_t i = 0; i + 6 < kind.mesh.corners.size(); i += 7)
    top = std::max(top, p.centre[2] + kind.mesh.corners[i] * p.x[2] + kind.mesh.corners[i + 1] * p.y[2] +
                            kind.mesh.corners[i + 2] * p.z[2]);
  return top;
}

TEST(MechanismParts, PinsHaveNoneAndEmptyCellsNeither) {
  EXPECT_TRUE(Bench("pin", {}).parts().kinds().empty());
  Bench bench("ball", {});
  bench.scene.spec.surface.actuator_of_cell.assign(9, 0);
  bench.scene.spec.surface.actuator_of_cell[4] = scene::kEmptyCell;
  EXPECT_EQ(bench.parts().kinds()[0].instances.size(), 8u);
  bench.scene.spec.surface.border_height = 6.0;  // the ring is a wall then
  EXPECT_EQ(bench.parts().kinds()[0].instances.size(), 0u);
}

TEST(MechanismParts, WhatTurnsTouchesTheCellsTopAtEveryAngle) {
  for (const std::string model : {"ball", "wheels", "rotor"})
    for (const float angle : {0.0F, 0.7F, 2.0F}) {
      Bench bench(model, {angle, 0.4F, 0.0F});
      const ActuatorGeometry parts = bench.parts();
      for (const MeshInstance& p : parts.kinds()[0].instances)
        EXPECT_NEAR(top_of(parts.kinds()[0], p), 1.0F, 0.04F) << model << " at " << angle;
      EXPECT_GT(parts.recess()[4], 0.05F);
    }
}

TEST(MechanismParts, ATurnedWheelDrivesAlongItsDirection) {
  // Wheel a drives east and turns about north; a quarter of a turn takes its own x axis down.
  Bench bench("wheels", {std::numbers::pi_v<float> / 2, 0.0F, 0.0F});
  const ActuatorGeometry parts = bench.parts();
  const auto& all = parts.kinds()[0].instances;
  ASSERT_EQ(all.size(), 18u);
  EXPECT_NEAR(vec(all[0].x).normalized().z(), -1.0F, 1e-5F);
  EXPECT_NEAR(std::abs(vec(all[0].y).normalized().y()), 1.0F, 1e-5F);
  EXPECT_NEAR(std::abs(vec(all[1].y).normalized().x()), 1.0F, 1e-5F);
}

TEST(MechanismParts, AnArrowPointsAlongTheForceAndGrowsWithIt) {
  Bench weak("force_field", {0.0F, 0.2F, 0.0F}), strong("force_field", {0.0F, -1.0F, 0.0F}),
      none("force_field", {});
  const ActuatorGeometry small = weak.parts(), large = strong.parts();
  EXPECT_GT(vec(small.kinds()[0].instances[0].x).y(), 0.1F);
  EXPECT_LT(vec(large.kinds()[0].instances[0].x).y(), -0.4F);
  EXPECT_TRUE(none.parts().kinds()[0].instances.empty());
}

TEST(MechanismParts, PolesAreRedAndBlueAndPaleWhenWeak) {
  const auto core = [](float level) {
    return Bench("magnet", {0, 0, level}).parts().kinds()[0].instances[0].paint;
  };
  EXPECT_GT(core(1.0F)[0], core(1.0F)[2] + 50);
  EXPECT_GT(core(-1.0F)[2], core(-1.0F)[0] + 50);
  EXPECT_GT(core(0.1F)[1], core(1.0F)[1]);
}

TEST(MechanismParts, APlumeLeansAndGrowsWithTheFlow) {
  const auto plume = [](float flow) {
    return Bench("air_jet", {std::numbers::pi_v<float>, 0, flow}, {{"lean", {0.5}}}).parts().kinds()[1];
  };
  EXPECT_TRUE(plume(0.0F).instances.empty());
  EXPECT_TRUE(plume(1.0F).translucent);
  EXPECT_LT(plume(1.0F).instances[0].z[0], -0.3F) << "towards the west";
  EXPECT_GT(plume(1.0F).instances[0].z[2], plume(0.3F).instances[0].z[2] + 0.2F);
}

TEST(MechanismParts, APlateLeansAsTheSkinDoes) {
  Bench bench("tile", {0, 0, 1});
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      bench.scene.snapshot.height[static_cast<std::size_t>(3 * row + column)] =
          0.2F * static_cast<float>(column);
  const ActuatorGeometry parts = bench.parts();
  const Eigen::Vector3f up = vec(parts.kinds()[0].instances[4].z).normalized();
  EXPECT_NEAR(up.x() / up.z(), -0.2F, 1e-4F);
}

TEST(MechanismParts, StandsWhereTheLayoutPutsTheCell) {
  Bench bench("wheels", {});
  bench.scene.spec.surface.cell_poses.assign(9, {5.0, -2.0, std::numbers::pi / 2});
  const MeshInstance p = bench.parts().kinds()[0].instances[0];
  EXPECT_NEAR(std::abs(vec(p.y).normalized().x()), 1.0F, 1e-5F);
  EXPECT_LT(std::hypot(p.centre[0] - 5.0F, p.centre[1] + 2.0F), 0.5F);
}

TEST(MechanismParts, RestsWhereNoMotionIsKnown) {
  Bench bench("air_jet", {0, 0, 1});
  bench.scene.snapshot.actuator_state.clear();
  EXPECT_TRUE(bench.parts().kinds()[1].instances.empty());
}

}  // namespace
}  // namespace smartsurf::view
