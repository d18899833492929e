// Loads and runs the example experiments.
#include <algorithm>

#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

class ExampleTest : public ScriptTest {
 protected:
  void run(const std::string& name, std::uint64_t ticks) {
    experiment.emplace(Experiment::load(std::filesystem::path(SMARTSURF_EXAMPLES) / name, options));
    simulation.emplace(experiment->scene());
    experiment->start(*simulation);
    run_ticks(*experiment, 0, ticks);
    experiment->finish();
  }
  std::optional<Experiment> experiment;
  std::optional<FakeSimulation> simulation;
};

TEST_F(ExampleTest, Drop) {
  run("drop.lua", 300);
  EXPECT_GE(experiment->scene().objects.size(), 3u);
}

TEST_F(ExampleTest, Sensors) {
  run("sensors.lua", 70);
  EXPECT_EQ(experiment->scene().surface.sensors.size(), 7u);
  EXPECT_EQ(simulation->log, (std::vector<std::string>{"stop"}));
}

TEST_F(ExampleTest, WaveTravelsEast) {
  run("wave.lua", 60);
  const std::vector<float> before = simulation->last_targets;
  experiment->tick(61.0 / 60.0, 61);
  const int columns = experiment->scene().surface.columns;
  ASSERT_EQ(before.size(), static_cast<std::size_t>(experiment->scene().surface.cell_count()));
  const auto crest = [&](const std::vector<float>& row) {
    return std::max_element(row.begin() + columns, row.begin() + 2 * columns) - row.begin() - columns;
  };
  EXPECT_NE(before, simulation->last_targets);
  EXPECT_GE(crest(simulation->last_targets), crest(before));
}

TEST_F(ExampleTest, RainCountFollowsOption) {
  options.overrides = {{"rate", "10"}, {"count", "25"}};
  run("rain.lua", 60 * 5);
  const auto drops = std::count_if(simulation->log.begin(), simulation->log.end(),
                                   [](const std::string& entry) { return entry.starts_with("spawn"); });
  EXPECT_EQ(drops, 25);
}

}  // namespace
}  // namespace smartsurf::script
