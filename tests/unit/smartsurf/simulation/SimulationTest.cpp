#include "smartsurf/simulation/Simulation.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

using namespace smartsurf;

namespace {

// Loads experiments from script text and advances them by ticks.
class SimulationTest : public testing::Test {
 protected:
  script::Experiment load(const std::string& text) {
    const auto path =
        std::filesystem::temp_directory_path() / ("simulation_test_" + std::to_string(getpid()) + ".lua");
    std::ofstream(path) << text;
    auto experiment = script::Experiment::load(path);
    std::filesystem::remove(path);
    return experiment;
  }
  static void tick(simulation::Simulation& s) {
    s.run_script();
    for (int i = 0; i < s.scene().world.steps_per_tick(); ++i) {
      s.plan_actuators();
      s.step_physics();
      s.commit_actuators();
    }
    s.finish_tick();
    s.sense();
  }
};

const std::string kTable = R"(
world { control_period = 1/60, dt = 1/240 }
surface { rows = 16, columns = 16, actuator = pin {}, sensors = { proximity { range = 8 } } }
)";

}  // namespace

TEST_F(SimulationTest, ScriptSpawnsPushesAndRemovesObjects) {
  auto experiment = load(kTable + R"(
local id = sphere { radius = 1, position = {8, 8, 1}, label = 'a' }
at(0.1, function() other = box { size = {1, 1, 1}, position = {3, 3, 0.5}, label = 'b' } end)
at(0.2, function() object(id):push { force = {100, 0, 0}, seconds = 0.5 } end)
at(1.0, function() object(other):remove() end)
)");
  simulation::Simulation s(experiment, 1, true);
  EXPECT_EQ(s.snapshot().object_count(), 1u);
  for (int i = 0; i < 8; ++i) tick(s);
  EXPECT_EQ(s.snapshot().object_count(), 2u);
  EXPECT_EQ(s.catalogue()[1].label, "b");
  for (int i = 0; i < 30; ++i) tick(s);
  EXPECT_GT(s.snapshot().velocity[0][0], 1.0F);
  for (int i = 0; i < 30; ++i) tick(s);
  EXPECT_EQ(s.snapshot().object_count(), 1u);
  EXPECT_EQ(s.snapshot().id[0], 0u);
  EXPECT_EQ(s.catalogue().size(), 2u);
}

TEST_F(SimulationTest, ScriptSetsTargetsOnlyWithoutController) {
  const std::string script = kTable + "on_tick(function() cells:target('height', 1, 16, 3.5) end)\n";
  auto experiment = load(script);
  simulation::Simulation free(experiment, 1, true);
  for (int i = 0; i < 60; ++i) tick(free);
  EXPECT_EQ(free.snapshot().height[15], 3.5F);
  EXPECT_EQ(free.snapshot().height[0], 0.0F);

  auto again = load(script);
  simulation::Simulation driven(again, 1, false);
  EXPECT_THROW(tick(driven), scene::InputError);
}

TEST_F(SimulationTest, ScriptReadsSensorsWithOneBasedIndices) {
  auto experiment = load(kTable + R"(
sphere { radius = 1, position = {3, 15 - 4, 1}, fixed = true }
at(0.0, function()
  assert(math.abs(cells:sense('proximity', 5, 4)) < 1e-6)
  assert(cells:sense('proximity_hit', 5, 4) == 1)
  assert(cells:sense('proximity', 1, 1) == 8)
  stop('seen', false)
end)
)");
  simulation::Simulation s(experiment, 1, true);
  tick(s);
  const simulation::ScriptRequests requests = s.take_requests();
  EXPECT_TRUE(requests.stop);
  EXPECT_EQ(requests.stop_message, "seen");
  EXPECT_EQ(requests.success, false);
  EXPECT_FALSE(s.take_requests().stop);
}

TEST_F(SimulationTest, ResultIsIndependentOfThreadCount) {
  const std::string script = kTable + R"(
for i = 1, 12 do sphere { radius = 0.8 + i / 20, position = {random(2, 13), random(2, 13), 3 + 2 * i} } end
on_tick(function(t, tick) cells:target('height', 1 + tick % 16, 1 + (tick * 7) % 16, 2 * (tick % 3)) end)
)";
  std::uint64_t hash[2];
  for (const int threads : {1, 2}) {
    auto experiment = load(script);
    simulation::Simulation s(experiment, threads, true);
    for (int i = 0; i < 240; ++i) tick(s);
    hash[threads - 1] = s.snapshot().state_hash;
  }
  EXPECT_EQ(hash[0], hash[1]);
}

TEST_F(SimulationTest, OffTablePolicy) {
  for (const bool remove : {false, true}) {
    auto experiment = load(std::string("world { off_table = '") + (remove ? "remove" : "keep") + R"(' }
surface { rows = 8, columns = 8, actuator = pin {} }
gone = {}
local rolls = sphere { radius = 0.5, position = {7, 4, 0.5}, velocity = {6, 0, 0} }
local stays = sphere { radius = 0.5, position = {2, 2, 0.5} }
on_leave(function(id) gone[#gone + 1] = id; assert(object(id):position() > 7.5) end)
at(0.5, function() assert(#gone == 1 and gone[1] == rolls and object(stays):alive()) end)
)");
    simulation::Simulation s(experiment, 1, true);
    for (int i = 0; i < 36; ++i) tick(s);
    EXPECT_EQ(s.snapshot().object_count(), remove ? 1U : 2U);
    EXPECT_EQ(s.departures().total_departures(), 1U);
    EXPECT_EQ(s.departures().off_table_count(), remove ? 0U : 1U);
  }
}
