#include "smartsurf/view/model/ActuatorGeometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

// 3 × 3 cells with one actuator model, all in the same state.
struct ActuatorFixture {
  ActuatorFixture(const std::string& model, const scene::ActuatorState& motion,
                  const scene::ParameterValues& values = {})
      : scene(3, 3, 1.0F) {
    scene::ActuatorSpec spec = scene::find_actuator_kind(model)->default_spec();
    for (const auto& [name, value] : values) spec.values[name] = value;
    scene.spec.surface.actuators = {spec};
    derive_pin_spec(scene.spec.surface);
    scene.snapshot.actuator_state.assign(9, motion);
  }
  ActuatorGeometry geometry() {
    ActuatorGeometry geometry(scene.spec.surface);
    geometry.update(scene.snapshot);
    return geometry;
  }
  TestScene scene;
};

Eigen::Vector3f to_vector(const std::array<float, 3>& a) { return Eigen::Vector3f(a.data()); }

// World z of the instance's highest vertex.
float highest_vertex(const InstancedMesh& mesh, const MeshInstance& p) {
  float top = -1e9F;
  for (std::size_t i = 0; i + 6 < mesh.mesh.vertices.size(); i += 7)
    top = std::max(top, p.centre[2] + mesh.mesh.vertices[i] * p.x[2] + mesh.mesh.vertices[i + 1] * p.y[2] +
                            mesh.mesh.vertices[i + 2] * p.z[2]);
  return top;
}

TEST(ActuatorGeometry, SkipsPinsEmptyCellsAndFixedBorder) {
  EXPECT_TRUE(ActuatorFixture("pin", {}).geometry().meshes().empty());
  ActuatorFixture bench("ball", {});
  bench.scene.spec.surface.actuator_of_cell.assign(9, 0);
  bench.scene.spec.surface.actuator_of_cell[4] = scene::kEmptyCell;
  EXPECT_EQ(bench.geometry().meshes()[0].instances.size(), 8u);
  bench.scene.spec.surface.border_height = 6.0;  // turns the border cells into a wall
  EXPECT_EQ(bench.geometry().meshes()[0].instances.size(), 0u);
}

TEST(ActuatorGeometry, RotatingPartsTouchCellTopAtEveryAngle) {
  for (const std::string model : {"ball", "wheels", "rotor"})
    for (const float angle : {0.0F, 0.7F, 2.0F}) {
      ActuatorFixture bench(model, {angle, 0.4F, 0.0F});
      const ActuatorGeometry parts = bench.geometry();
      for (const MeshInstance& p : parts.meshes()[0].instances)
        EXPECT_NEAR(highest_vertex(parts.meshes()[0], p), 1.0F, 0.04F) << model << " at " << angle;
      EXPECT_GT(parts.recess()[4], 0.05F);
    }
}

TEST(ActuatorGeometry, WheelsRotateAboutTheirOwnAxes) {
  // Wheel a drives east and rotates about the y axis; a quarter turn points its x axis down.
  ActuatorFixture bench("wheels", {std::numbers::pi_v<float> / 2, 0.0F, 0.0F});
  const ActuatorGeometry parts = bench.geometry();
  const auto& all = parts.meshes()[0].instances;
  ASSERT_EQ(all.size(), 18u);
  EXPECT_NEAR(to_vector(all[0].x).normalized().z(), -1.0F, 1e-5F);
  EXPECT_NEAR(std::abs(to_vector(all[0].y).normalized().y()), 1.0F, 1e-5F);
  EXPECT_NEAR(std::abs(to_vector(all[1].y).normalized().x()), 1.0F, 1e-5F);
}

TEST(ActuatorGeometry, ArrowPointsAlongForceAndGrowsWithIt) {
  ActuatorFixture weak("force_field", {0.0F, 0.2F, 0.0F}), strong("force_field", {0.0F, -1.0F, 0.0F}),
      none("force_field", {});
  const ActuatorGeometry small = weak.geometry(), large = strong.geometry();
  EXPECT_GT(to_vector(small.meshes()[0].instances[0].x).y(), 0.1F);
  EXPECT_LT(to_vector(large.meshes()[0].instances[0].x).y(), -0.4F);
  EXPECT_TRUE(none.geometry().meshes()[0].instances.empty());
}

TEST(ActuatorGeometry, CoilColourShowsPolarityAndStrength) {
  const auto core = [](float level) {
    return ActuatorFixture("magnet", {0, 0, level}).geometry().meshes()[0].instances[0].base_colour;
  };
  EXPECT_GT(core(1.0F)[0], core(1.0F)[2] + 50);
  EXPECT_GT(core(-1.0F)[2], core(-1.0F)[0] + 50);
  EXPECT_GT(core(0.1F)[1], core(1.0F)[1]);
}

TEST(ActuatorGeometry, PlumeTiltsAndGrowsWithFlow) {
  const auto plume = [](float flow) {
    return ActuatorFixture("air_jet", {std::numbers::pi_v<float>, 0, flow}, {{"lean", {0.5}}})
        .geometry()
        .meshes()[1];
  };
  EXPECT_TRUE(plume(0.0F).instances.empty());
  EXPECT_TRUE(plume(1.0F).translucent);
  EXPECT_LT(plume(1.0F).instances[0].z[0], -0.3F) << "towards the west";
  EXPECT_GT(plume(1.0F).instances[0].z[2], plume(0.3F).instances[0].z[2] + 0.2F);
}

TEST(ActuatorGeometry, PlateFollowsSurfaceSlope) {
  ActuatorFixture bench("tile", {0, 0, 1});
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      bench.scene.snapshot.height[static_cast<std::size_t>(3 * row + column)] =
          0.2F * static_cast<float>(column);
  const ActuatorGeometry parts = bench.geometry();
  const Eigen::Vector3f up = to_vector(parts.meshes()[0].instances[4].z).normalized();
  EXPECT_NEAR(up.x() / up.z(), -0.2F, 1e-4F);
}

TEST(ActuatorGeometry, TipsReachTheTop) {
  for (const double shape : {1.0, 2.0, 3.0}) {
    const ActuatorGeometry parts = ActuatorFixture("pin", {}, {{"tip.shape", {shape}}}).geometry();
    ASSERT_EQ(parts.meshes().size(), 1u) << shape;
    const InstancedMesh& tips = parts.meshes()[0];
    EXPECT_EQ(tips.instances.size(), 9u);
    EXPECT_NEAR(highest_vertex(tips, tips.instances[4]), 1.0F, 1e-5F) << shape;
    EXPECT_GE(parts.recess()[4], 2.0F) << "the square pin is hidden below the shaft";
  }
}

TEST(ActuatorGeometry, DeltaTipIsAWholeSphereOrCylinder) {
  for (const double length : {0.0, 1.5}) {  // 0: a sphere
    scene::ParameterValues values{{"tip.radius", {0.25}}};
    if (length > 0.0) values["tip.shape"] = {1.0}, values["tip.length"] = {length};
    const ActuatorGeometry geometry = ActuatorFixture("delta", {}, values).geometry();
    const std::vector<float>& vertices = geometry.meshes()[0].mesh.vertices;
    const float depth = length > 0.0 ? 1.5F : 0.5F;
    float lowest = 0.0F, mean = 0.0F;
    for (std::size_t i = 0; i < vertices.size(); i += 7) {
      lowest = std::min(lowest, vertices[i + 2]);
      mean += vertices[i + 2] * 7.0F / static_cast<float>(vertices.size());
    }
    EXPECT_NEAR(lowest, -depth, 1e-5F);
    EXPECT_NEAR(mean, -0.5F * depth, 1e-4F);
  }
}

TEST(ActuatorGeometry, FaceOfAHullHasOneColour) {
  const std::vector<double> box{-0.3, -0.2, -0.1, 0.4, -0.2, -0.1, -0.3, 0.5, -0.1, 0.4, 0.5, -0.1,
                                -0.3, -0.2, 0.2,  0.4, -0.2, 0.2,  -0.3, 0.5, 0.2,  0.4, 0.5, 0.2};
  const ActuatorGeometry geometry = ActuatorFixture("rotor", {}, {{"points", box}}).geometry();
  const std::vector<float>& vertices = geometry.meshes()[0].mesh.vertices;
  std::map<std::array<int, 3>, std::set<float>> shares;  // by normal
  for (std::size_t i = 0; i < vertices.size(); i += 7)
    shares[{static_cast<int>(std::lround(vertices[i + 3])), static_cast<int>(std::lround(vertices[i + 4])),
            static_cast<int>(std::lround(vertices[i + 5]))}]
        .insert(vertices[i + 6]);
  ASSERT_EQ(shares.size(), 6u);
  int accents = 0;
  for (const auto& [normal, share] : shares) {
    EXPECT_EQ(share.size(), 1u);
    accents += static_cast<int>(share.count(1.0F));
  }
  EXPECT_EQ(accents, 3);
}

TEST(ActuatorGeometry, DeltaTipStandsAtItsOffsetOnThreeArms) {
  const ActuatorGeometry parts =
      ActuatorFixture("delta", {0.5F, -1.0F, 0}, {{"workspace.radius", {0.4}}}).geometry();
  const ActuatorGeometry rest = ActuatorFixture("delta", {0, 0, 0}, {{"workspace.radius", {0.4}}}).geometry();
  const InstancedMesh &tips = parts.meshes()[0], &arms = parts.meshes()[1];
  EXPECT_NEAR(highest_vertex(tips, tips.instances[4]), 1.0F, 1e-5F);
  const Eigen::Vector3f moved =
      to_vector(tips.instances[4].centre) - to_vector(rest.meshes()[0].instances[4].centre);
  EXPECT_NEAR((moved - Eigen::Vector3f(0.2F, -0.4F, 0)).norm(), 0.0F, 1e-6F);
  ASSERT_EQ(arms.instances.size(), 27u);
  for (const MeshInstance& arm : arms.instances)  // half of twice the sum of the radii, 0.4 both
    EXPECT_NEAR(to_vector(arm.z).norm(), 0.8F, 1e-5F);
}

TEST(ActuatorGeometry, TiltedPlateTurnsByRollThenPitch) {
  const ActuatorGeometry parts = ActuatorFixture("tile", {0.3F, 0.2F, 0}, {{"command", {1}}}).geometry();
  const Eigen::Vector3f up = to_vector(parts.meshes()[0].instances[4].z).normalized();
  EXPECT_NEAR(up.x(), std::sin(0.2F) * std::cos(0.3F), 1e-5F);
  EXPECT_NEAR(up.y(), -std::sin(0.3F), 1e-5F);
}

TEST(ActuatorGeometry, UsesCellPoseOfFreeLayout) {
  ActuatorFixture bench("wheels", {});
  bench.scene.spec.surface.cell_poses.assign(9, {5.0, -2.0, std::numbers::pi / 2});
  const MeshInstance p = bench.geometry().meshes()[0].instances[0];
  EXPECT_NEAR(std::abs(to_vector(p.y).normalized().x()), 1.0F, 1e-5F);
  EXPECT_LT(std::hypot(p.centre[0] - 5.0F, p.centre[1] + 2.0F), 0.5F);
}

TEST(ActuatorGeometry, SkinCoversPinsAndTips) {
  for (const double tip : {0.0, 1.0}) {  // flat, hemisphere
    ActuatorFixture bench("pin", {}, {{"tip.shape", {tip}}, {"tip.radius", {0.4}}});
    constexpr int kNodes = 9;
    bench.scene.spec.surface.skin = scene::SkinSpec{.rows = kNodes, .columns = kNodes, .margin = 0.5};
    const auto tent = [](float x, float y) { return 3.0F - std::hypot(x - 1.0F, y - 1.0F); };
    const auto node = [](int i) { return -0.5F + 3.0F * static_cast<float>(i) / (kNodes - 1); };
    for (int r = 0; r < kNodes; ++r)
      for (int c = 0; c < kNodes; ++c)
        bench.scene.snapshot.skin_height.push_back(tent(node(c), 2.0F - node(r)));
    for (int cell = 0; cell < 9; ++cell)
      bench.scene.snapshot.height[static_cast<std::size_t>(cell)] =
          tent(static_cast<float>(cell % 3), static_cast<float>(2 - cell / 3));
    const ActuatorGeometry geometry = bench.geometry();
    const double half_edge = 0.5 * bench.scene.spec.surface.pin.top_x;
    ASSERT_EQ(geometry.recess().size(), 9u);
    for (std::size_t cell = 0; cell < 9; ++cell) {
      const auto x = static_cast<float>(cell % 3), y = static_cast<float>(2 - cell / 3);
      float drawn = bench.scene.snapshot.height[cell] - geometry.recess()[cell];
      if (tip != 0.0) {
        const InstancedMesh& tips = geometry.meshes().front();
        EXPECT_LT(drawn, tips.instances[cell].centre[2]);
        drawn = highest_vertex(tips, tips.instances[cell]);
      }
      const auto reach = static_cast<float>(half_edge);
      for (const float dx : {-reach, reach})
        for (const float dy : {-reach, reach}) EXPECT_LT(drawn, tent(x + dx, y + dy)) << "cell " << cell;
    }
  }
}

TEST(ActuatorGeometry, SkinHasTheAccentWhereActuatorsHoldIt) {
  ActuatorFixture bench("pin", {});
  bench.scene.spec.surface.actuator_of_cell.assign(9, scene::kEmptyCell);
  bench.scene.spec.surface.actuator_of_cell[2] = 0;  // in the north-east
  bench.scene.spec.surface.skin = scene::SkinSpec{.rows = 31, .columns = 31, .margin = 0.5};
  const ActuatorGeometry geometry = bench.geometry();
  const std::vector<float>& vertices = geometry.meshes().back().mesh.vertices;
  int held = 0;
  for (std::size_t i = 0; i < vertices.size(); i += 7) {
    if (vertices[i + 6] == 0.0F) continue;
    ++held;
    EXPECT_NEAR(vertices[i], 2.0F, 0.5F);
    EXPECT_NEAR(vertices[i + 1], 2.0F, 0.5F);
  }
  EXPECT_GT(held, 50);
}

TEST(ActuatorGeometry, RestsWithoutActuatorState) {
  ActuatorFixture bench("air_jet", {0, 0, 1});
  bench.scene.snapshot.actuator_state.clear();
  EXPECT_TRUE(bench.geometry().meshes()[1].instances.empty());
}

}  // namespace
}  // namespace smartsurf::view
