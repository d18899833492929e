#include "smartsurf/run/display/UserInteraction.h"

#include <gtest/gtest.h>

namespace smartsurf::run {
namespace {

script::Experiment experiment() {
  script::LoadOptions options;
  options.source = R"(
world { control_period = 1/60, dt = 1/240 }
surface { rows = 16, columns = 16, actuator = pin {}, base = function(r, c) return r == 5 and c == 6 and 1 or 0 end }
sphere { radius = 1, position = {8, 8, 1}, label = 'ball' }
box { size = {1, 1, 1}, position = {3, 3, 0.5}, fixed = true }
)";
  return script::Experiment::load("hand.lua", options);
}

struct UserInteractionTest : testing::Test {
  UserInteractionTest() : script(experiment()), simulation(script, 1, true) {}
  bool tick() {
    simulation.run_script();
    const bool interacted = interaction.apply(requests, simulation);
    for (int i = 0; i < simulation.scene().world.steps_per_tick(); ++i) {
      simulation.plan_actuators();
      simulation.step_physics();
      simulation.commit_actuators();
    }
    simulation.finish_tick();
    return interacted;
  }
  script::Experiment script;
  simulation::Simulation simulation;
  UserInteraction interaction;
  InteractionRequests requests;
};

TEST_F(UserInteractionTest, NoRequestsNoInteraction) {
  EXPECT_FALSE(tick());
  EXPECT_EQ(simulation.snapshot().object_count(), 2u);
}

TEST_F(UserInteractionTest, PullLiftsObjectToTarget) {
  requests.pull = view::Pull{0, {0.0, 0.0, 1.0}, {5.0, 9.0, 6.0}};
  for (int i = 0; i < 180; ++i) EXPECT_TRUE(tick());
  // The ball may swing about the grip point, which stays at the target.
  const Eigen::Vector3d grip = view::Tools::anchor_position(*requests.pull, simulation.snapshot());
  EXPECT_LT((grip - requests.pull->target).norm(), 0.3) << grip.transpose();
  requests.pull.reset();
  for (int i = 0; i < 120; ++i) EXPECT_FALSE(tick());
  EXPECT_LT(simulation.snapshot().position[0][2], 1.5f) << "does not fall when released";
}

TEST_F(UserInteractionTest, DistantTargetLimitsAcceleration) {
  requests.pull = view::Pull{0, {0.0, 0.0, 1.0}, {8.0, 8.0, 1e6}};
  tick();
  EXPECT_LT(simulation.snapshot().velocity[0][2], 10.0f);
}

TEST_F(UserInteractionTest, PokedCellRisesAndReturnsToItsTarget) {
  requests.poke = view::Poke{4, 5, 3.0};
  const auto height = [&](int row, int column) {
    return simulation.snapshot().height[static_cast<std::size_t>(row * 16 + column)];
  };
  for (int i = 0; i < 60; ++i) EXPECT_TRUE(tick());
  EXPECT_FLOAT_EQ(height(4, 5), 3.0f);
  EXPECT_FLOAT_EQ(height(4, 6), 0.0f);
  requests.poke->column = 6;
  for (int i = 0; i < 60; ++i) tick();
  EXPECT_FLOAT_EQ(height(4, 5), 1.0f) << "its base";
  EXPECT_FLOAT_EQ(height(4, 6), 3.0f);
  requests.poke.reset();
  for (int i = 0; i < 60; ++i) tick();
  EXPECT_FLOAT_EQ(height(4, 6), 0.0f);
}

TEST_F(UserInteractionTest, FaultyCellIgnoresTargetsUntilRepaired) {
  const auto height = [&] { return simulation.snapshot().height[4 * 16 + 5]; };
  const auto command = [&](float value) { simulation.set_target("height", 4, 5, value); };
  command(2.0f);
  for (int i = 0; i < 60; ++i) tick();
  requests.faults = {{4, 5, view::FaultKind::kStuck}};
  EXPECT_TRUE(tick());
  command(5.0f);
  for (int i = 0; i < 60; ++i) EXPECT_TRUE(tick());
  EXPECT_FLOAT_EQ(height(), 3.0f) << "stuck at its height";
  requests.faults = {{4, 5, view::FaultKind::kDead}};
  for (int i = 0; i < 60; ++i) tick();
  EXPECT_FLOAT_EQ(height(), 1.0f);
  requests.faults = {{4, 5, view::FaultKind::kNone}};
  for (int i = 0; i < 60; ++i) tick();
  EXPECT_FLOAT_EQ(height(), 3.0f) << "target before the fault";
  EXPECT_FALSE(tick());
}

TEST_F(UserInteractionTest, DroppedObjectsAreSpawnedOnce) {
  scene::ObjectSpec box;
  box.shape = scene::ShapeKind::kBox;
  box.position = {12.0, 12.0, 3.0};
  requests.dropped_objects = {box, box};
  EXPECT_TRUE(tick());
  EXPECT_EQ(simulation.snapshot().object_count(), 4u);
  EXPECT_EQ(simulation.catalogue().size(), 4u);
  EXPECT_FALSE(tick()) << "dropped again";
}

TEST_F(UserInteractionTest, RemovedObjectIsNotPulled) {
  requests.pull = view::Pull{0, {0.0, 0.0, 1.0}, {5.0, 9.0, 6.0}};
  simulation.remove(0);
  EXPECT_FALSE(tick());
}

}  // namespace
}  // namespace smartsurf::run
