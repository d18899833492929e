#include "smartsurf/simulation/Environment.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <span>
#include <tuple>

#include "smartsurf/simulation/EnvironmentBatch.h"
#include "tests/unit/common/HostArithmetic.h"

namespace smartsurf::simulation {
namespace {

struct Script {
  const char *name, *text;
  friend void PrintTo(const Script& script, std::ostream* out) { *out << script.name; }
};

// Objects of all shapes that roll, pile up and sleep; variables, timers and random numbers of the script.
constexpr Script kCrowd{"Crowd", R"(
surface { rows = 12, columns = 12, border = { height = 6 }, actuator = pin { range = {0, 4}, max_speed = 8 },
          sensors = { proximity { range = 6 }, pressure {} } }
local ids, state = {}, { draws = 0 }
for i = 1, 6 do
  local p = { 1 + 1.5 * i, 1 + 1.4 * i, 4 + i }
  ids[i] = i % 3 == 0 and sphere { radius = 0.9, position = p } or i % 3 == 1 and box { size = {1.6, 1.2, 1}, com = {0.3, 0, -0.2}, position = p }
           or cylinder { radius = 0.7, height = 1.4, position = p }
end
on_reset(function()
  for i, id in ipairs(ids) do object(id):teleport { position = {random(3, 8), random(3, 8), 5 + 1.5 * i} } end
end)
every(0.1, function()
  state.draws = state.draws + random()
  state[#state + 1] = sphere { radius = 0.4, com = {0, 0, -0.15}, position = {random(3, 8), random(3, 8), 9} }
  if #state > 3 then object(table.remove(state, 1)):remove() end
end)
reward(function() return state.draws + #state end)
)"};
// Draws while it loads; faults and sensor errors depend on the seed; a unit of length that is not the pitch.
constexpr Script kNoisy{"Noisy", R"(
surface { rows = 8, columns = 8, pitch = 2, actuator = pin { range = {0, 4}, latency = 2 },
          sensors = { proximity { range = 6, noise = 0.05, drift = 0.1, latency = 2 } } }
faults { actuator = { stuck = 0.05, latency = 1 } }
for i = 1, 3 do box { size = {2, 2, 2}, position = {random(2, 12), random(2, 12), 4 + 2 * i} } end
for i = 1, math.floor(random(1, 9)) do every(0.1 * i, function() random() end) end
reward(function() return random() end)
)"};
// Joints that are driven, created and removed, and handles to them in variables.
constexpr Script kJoints{"Joints", R"(
surface { rows = 10, columns = 10, actuator = pin { range = {0, 3} }, sensors = { proximity { range = 6 } } }
local arm = box { size = {3, 0.6, 0.4}, position = {4, 4, 4} }
local bob = sphere { radius = 0.5, position = {6, 4, 4} }
local crank = joint { kind = 'hinge', a = arm, anchor = {3, 4, 4}, axis = {0.2, 1, 0}, friction = 0.1, limits = {-2, 2} }
local string, shaft = joint { kind = 'ball', a = bob, b = arm, anchor = {5.5, 4, 4} }
every(0.2, function(t)
  shaft = shaft or joint(crank)
  shaft:motor { speed = random(-3, 3), max_torque = 20 }
  if joint(string):alive() then joint(string):remove() end
  string = joint { kind = 'slider', a = bob, anchor = {object(bob):position()}, axis = {0, 0, 1}, spring = { stiffness = 30 } }
end)
reward(function() return shaft and shaft:coordinate() + shaft:effort() or 0 end)
)"};

// Tiles that heave and tilt beside pins with round tips.
constexpr Script kTilting{"Tilting", R"(
surface { rows = 8, columns = 8, sensors = { proximity { range = 6 } },
          actuators = { t = tile { command = 'pose' }, h = pin { range = {0, 2}, tip = { shape = 'hemisphere' } } },
          cells = { 'th', 'ht' } }
for i = 1, 3 do
  sphere { radius = 0.8, position = { 2 * i, 3, 2 + i } }
  box { size = {1.5, 1, 1}, position = { 2 * i, 5, 2 + i } }
end
reward(function() return (object(0):position()) end)
)"};

// Delta robots, rigid and compliant, with their sensors.
constexpr Script kDeltas{"Deltas", R"(
surface { rows = 8, columns = 8, sensors = { tip_force {}, joint_position {} },
          actuators = { c = delta { stiffness = 200 }, r = delta { tip = { shape = 'rounded_cylinder' } },
                        l = delta { max_force = 30 } }, cells = { 'cr', 'lc' } }
for i = 1, 3 do
  sphere { radius = 0.8, position = { 2 * i, 3, 2 + i } }
  box { size = {1.5, 1, 1}, position = { 2 * i, 5, 2 + i } }
end
reward(function() return (object(0):position()) end)
)"};

// A taut skin over pins, tiles and deltas, and an elastic one, with what they sense.
constexpr Script kTautSkin{"TautSkin", R"(
surface { rows = 6, columns = 6, sensors = { skin_height { resolution = 2 }, skin_strain {}, skin_contact { resolution = 3 } },
          actuators = { t = tile { command = 'pose' }, p = pin { range = {0, 2} }, d = delta {} }, cells = { 'tp', 'pd' },
          skin = { nodes = {33, 37}, edge = { height = 0.2 } } }
for i = 1, 3 do
  sphere { radius = 0.3, position = { 1.5 * i, 2, 2 + i } }
  box { size = {1, 0.7, 0.5}, position = { 1.5 * i, 4, 2 + i } }
end
reward(function() return (object(0):position()) end)
)"};
constexpr Script kElasticSkin{"ElasticSkin", R"(
surface { rows = 6, columns = 6, pitch = 2, sensors = { skin_height { resolution = 2 }, skin_contact {} },
          actuator = pin { range = {0, 2}, top = 0.5 }, border = { height = 3 },
          skin = { kind = 'elastic', nodes = {25, 25}, density = 0.2 } }
for i = 1, 3 do
  sphere { radius = 0.6, position = { 1 + 2 * i, 4, 3 + i } }
  box { size = {1.5, 1, 1}, position = { 1 + 2 * i, 7, 3 + i } }
end
reward(function() return (object(0):position()) end)
)"};

class EnvironmentTest : public testing::TestWithParam<Script> {
 protected:
  EnvironmentTest()
      : path_(std::filesystem::temp_directory_path() /
              ("environment_test_" + std::to_string(getpid()) + ".lua")) {
    std::ofstream(path_) << GetParam().text;
  }
  ~EnvironmentTest() override { std::filesystem::remove(path_); }

  EnvironmentOptions options(std::uint64_t seed, int threads = 1) const {
    EnvironmentOptions options;
    options.experiment = path_.string();
    options.seed = seed;
    options.threads = threads;
    return options;
  }
  // Targets that change every fifth tick.
  static std::vector<float> targets(std::size_t cells, std::uint64_t tick) {
    std::vector<float> out(cells);
    for (std::size_t i = 0; i < cells; ++i) out[i] = static_cast<float>((i * 7 + tick / 5 * 13) % 17) / 8.0F;
    return out;
  }
  struct Tick {
    std::uint64_t hash;
    double reward;
    std::vector<float> observation;
    bool operator==(const Tick&) const = default;
  };
  static std::vector<Tick> drive(Environment& e, int ticks) {
    std::vector<Tick> trace;
    for (int i = 0; i < ticks; ++i) {
      for (std::size_t channel = 0; channel < e.scene().surface.actuator_channels().size(); ++channel)
        e.set_targets(static_cast<int>(channel),
                      targets(static_cast<std::size_t>(e.scene().surface.cell_count()),
                              e.simulation().snapshot().tick));
      const double reward = e.step().reward;
      trace.push_back(
          {e.simulation().snapshot().state_hash, reward, std::vector<float>(e.observation_size())});
      e.observe(trace.back().observation);
    }
    return trace;
  }

  std::filesystem::path path_;
};

TEST_P(EnvironmentTest, ResetEqualsNewEnvironment) {
  Environment used(options(5));
  drive(used, 40);
  for (const std::uint64_t seed : {9U, 5U}) {
    used.reset(seed);
    Environment fresh(options(seed));
    EXPECT_EQ(drive(used, 50), drive(fresh, 50)) << "seed " << seed;
  }
}

TEST_P(EnvironmentTest, RestoredStateContinuesWithSameBits) {
  for (const int warm_up : {0, 30, 120}) {
    Environment first(options(5));
    drive(first, warm_up);
    const std::string state = first.save();
    const std::vector<Tick> expected = drive(first, 50);
    first.restore(state);
    EXPECT_EQ(drive(first, 50), expected) << "after " << warm_up;
    Environment second(options(6, 2));
    drive(second, 23);
    second.restore(state);
    EXPECT_EQ(drive(second, 50), expected) << "in another environment, after " << warm_up;
  }
}

TEST_P(EnvironmentTest, DamagedStateChangesNothing) {
  Environment environment(options(5));
  drive(environment, 20);
  const std::string state = environment.save();
  for (std::size_t byte = 0; byte < state.size(); byte += byte < 64 ? 1 : 1 + state.size() / 16) {
    std::string damaged = state;
    damaged[byte] ^= static_cast<char>(1U << byte % 8);
    EXPECT_THROW(environment.restore(damaged), scene::InputError) << "byte " << byte;
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{10}, std::size_t{32}, state.size() - 1})
    EXPECT_THROW(environment.restore(std::string_view(state).substr(0, size)), scene::InputError) << size;
  EXPECT_THROW(environment.restore(state + '\0'), scene::InputError);
  Environment twin(options(5));
  drive(twin, 20);
  EXPECT_EQ(drive(environment, 20), drive(twin, 20));
}

TEST_P(EnvironmentTest, ArithmeticOfTheHostChangesNothing) {
  Environment first(options(5, 2));
  const std::vector<Tick> expected = drive(first, 30);
  const common::HostArithmetic host;
  Environment environment(options(6, 2));
  environment.reset(5);
  EXPECT_EQ(drive(environment, 30), expected);
  EXPECT_TRUE(common::HostArithmetic::is_set());
}

TEST_P(EnvironmentTest, BatchEqualsSingleEnvironments) {
  const std::vector<std::uint64_t> seeds{3, 4, 5, 6, 7};
  for (const int threads : {1, 3}) {
    EnvironmentBatch batch(options(0), seeds, threads, Autoreset::kNextStep);
    std::vector<std::unique_ptr<Environment>> single;
    for (const std::uint64_t seed : seeds) single.push_back(std::make_unique<Environment>(options(seed)));
    const scene::SurfaceSpec& surface = single[0]->scene().surface;
    const auto cells = static_cast<std::size_t>(surface.cell_count());
    std::vector<float> actions, observations(seeds.size() * batch.observation_size());
    std::vector<double> rewards(seeds.size());
    for (std::uint64_t tick = 0; tick < 30; ++tick) {
      actions.clear();
      for (std::size_t i = 0; i < seeds.size() * surface.actuator_channels().size(); ++i)
        std::ranges::copy(targets(cells, tick), std::back_inserter(actions));
      BatchArrays arrays;
      arrays.actions = actions;
      arrays.state.observations = observations;
      arrays.rewards = rewards;
      batch.step(arrays);
      for (std::size_t i = 0; i < seeds.size(); ++i) {
        const Tick expected = drive(*single[i], 1).front();
        EXPECT_EQ(batch.world(static_cast<int>(i)).simulation().snapshot().state_hash, expected.hash);
        EXPECT_EQ(rewards[i], expected.reward);
        EXPECT_TRUE(std::ranges::equal(
            std::span(observations).subspan(i * batch.observation_size(), batch.observation_size()),
            expected.observation));
      }
    }
  }
}

constexpr Script kPile{"Pile", R"(
surface { rows = 8, columns = 8, actuator = pin {} }
for _ = 1, 300 do sphere { radius = 0.5, position = {4, 4, 4} } end
)"};
using OverloadedEnvironmentTest = EnvironmentTest;

TEST_P(OverloadedEnvironmentTest, FailsAndSaysWhy) {
  Environment environment(options(1));
  for (int attempt = 0; attempt < 2; ++attempt) {
    try {
      environment.step();
      FAIL() << "300 spheres at one point";
    } catch (const scene::InputError& error) {
      const std::string message = error.what();
      EXPECT_NE(
          message.find(attempt == 0 ? "failed at tick 1: too many of the 300 objects overlap" : "reset it"),
          std::string::npos)
          << message;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Pile, OverloadedEnvironmentTest, testing::Values(kPile));

// Commands the next height in each frame.
class Rising final : public common::Controller, public common::ControllerFactory {
 public:
  void restart() override { height_ = 0.0F; }
  common::ControllerStatus answer(const common::SensorFrame&,
                                  std::span<const std::span<float>> targets) noexcept override {
    height_ += 0.1F;
    std::ranges::fill(targets.front(), height_);
    return common::ControllerStatus::kAnswered;
  }
  std::string error() const override { return {}; }
  std::unique_ptr<common::Controller> create(const common::ControlledSurface&) const override {
    return std::make_unique<Rising>();
  }

 private:
  float height_ = 0.0F;
};

TEST(EnvironmentController, CommandsWithoutHashingTheState) {
  EnvironmentOptions options;
  options.source =
      "surface { rows = 4, columns = 4, actuator = pin { range = {0, 4} }, sensors = { proximity {} } }";
  options.controller = std::make_shared<Rising>();
  Environment environment(options);
  const std::uint64_t hash_at_start = environment.simulation().snapshot().state_hash;
  for (int i = 0; i < 3; ++i) environment.step();
  EXPECT_EQ(environment.simulation().partial_snapshot().state_hash,
            hash_at_start);  // not computed since
  EXPECT_NE(environment.simulation().snapshot().state_hash, hash_at_start);
}

TEST(Environment, SnapshotHasTheActuatorsStateWhenAsked) {
  EnvironmentOptions options;
  options.source = "surface { rows = 2, columns = 3, actuator = wheels { radius = 0.5 } }";
  Environment asked_always(options), asked_once(options);
  for (Environment* environment : {&asked_always, &asked_once}) {
    environment->set_targets(0, std::vector<float>{1, 2, 3, 4, 5, 6});
    for (int i = 0; i < 30; ++i) {
      environment->step();
      if (environment == &asked_always) environment->simulation().snapshot();
    }
  }
  const auto &always = asked_always.simulation().snapshot().actuator_state,
             &once = asked_once.simulation().snapshot().actuator_state;
  ASSERT_EQ(once.size(), 6U);
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].a, always[i].a);
    EXPECT_GT(std::abs(once[i].a), 0.1F);
  }
}

TEST(EnvironmentMetrics, FollowEveryStepAndReset) {
  EnvironmentOptions options;
  options.experiment = "metrics.lua";
  options.source = R"(
surface { rows = 4, columns = 4 }
world { control_period = 1/10, dt = 1/100 }
metric('ticks', function(t, tick) return tick end)
metric('time', function(t) return t end)
)";
  Environment environment(options);
  const auto expect = [&](double ticks) {
    ASSERT_EQ(environment.metrics().size(), 2u);
    EXPECT_EQ(environment.metrics()[0].second, ticks);
    EXPECT_NEAR(environment.metrics()[1].second, ticks / 10.0, 1e-12);
  };
  for (int episode = 0; episode < 2; ++episode) {
    expect(0.0);
    for (int step = 1; step <= 3; ++step) {
      environment.step();
      expect(step);
    }
    environment.reset(7);
  }
}

TEST(EnvironmentFiles, AStateIsBoundToThem) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / ("environment_files_" + std::to_string(getpid()));
  fs::create_directory(folder);
  const auto write = [&](const std::string& file, const std::string& text) {
    std::ofstream(folder / file) << text;
  };
  const std::string hull = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
                    header = "row,column,channel,fault,value\n",
                    robot =
                        "<robot name='r'><link name='l'><collision><geometry><sphere "
                        "radius='1'/></geometry></collision></link></robot>";
  const struct {
    std::string name, text, other;
  } files[] = {{"required.lua", "return 9", "return 8"},
               {"done.lua", "gravity = 2", "gravity = 3"},
               {"opened.txt", "3", "4"},
               {"lines.txt", "4", "5"},
               {"faults.csv", header + "0,1,height,stuck,1\n", header + "0,1,height,stuck,2\n"},
               {"hull.obj", hull, "v 0 0 -0.1\n" + hull.substr(8)},
               {"robot.urdf", robot, robot + " "}};
  for (const auto& file : files) write(file.name, file.text);
  EnvironmentOptions options;
  options.experiment = (folder / "files.lua").string();
  options.source = R"(
    local n = require 'required'
    dofile 'done.lua'
    pcall(require, 'absent')
    n = n + tonumber(io.open('opened.txt'):read()) + (io.open('missing.txt') and 1 or 0)
    for line in io.lines('lines.txt') do n = n + tonumber(line) end
    world { gravity = -n, unit = 'm' }
    surface { rows = 4, columns = 4 }
    faults { map = 'faults.csv' }
    hull { file = 'hull.obj', position = {1, 1, 5}, mass = 1 }
    urdf { file = 'robot.urdf', position = {2, 2, 9} }
    on_tick(function() io.open('opened.txt') end))";
  const auto after = [](Environment& environment, int steps) {
    for (int step = 0; step < steps; ++step) environment.step();
    return environment.simulation().snapshot().state_hash;
  };
  Environment first(options);
  after(first, 5);
  const std::string state = first.save();
  const std::uint64_t expected = after(first, 5);
  Environment same(options);
  same.restore(state);
  EXPECT_EQ(after(same, 5), expected);
  const auto expect_refused = [&](const std::string& file) {
    Environment other(options), twin(options);
    after(other, 3), after(twin, 3);
    try {
      other.restore(state);
      ADD_FAILURE() << file;
    } catch (const scene::InputError& error) {
      EXPECT_NE(std::string(error.what()).find("of another experiment, file, option"), std::string::npos)
          << error.what();
    }
    EXPECT_EQ(after(other, 5), after(twin, 5)) << file;
  };
  for (const auto& file : files) {
    write(file.name, file.other);
    expect_refused(file.name);
    write(file.name, file.text);
  }
  for (const std::string file : {"absent.lua", "missing.txt"}) {
    write(file, "");
    expect_refused(file);
    fs::remove(folder / file);
  }
  fs::remove_all(folder);
}

TEST(EnvironmentVerdict, IsThatOfRunAndLiesInTheState) {
  const auto end_of = [](const std::string& script) {
    EnvironmentOptions options;
    options.experiment = "verdict.lua";
    options.source =
        "surface { rows = 2, columns = 2 } world { control_period = 1/10, dt = 1/100 } episode { seconds = 1 "
        "}\n" +
        script;
    Environment first(options), second(options);
    try {
      for (int step = 0; step < 6; ++step) first.step();
      second.restore(first.save());
      while (!second.step().truncated && second.outcome() == "done") {
      }
      second.finish();
    } catch (const scene::InputError&) {
    }
    const Verdict verdict = second.verdict();
    EXPECT_EQ(second.has_succeeded(), verdict.success == true);
    return std::tuple(second.outcome(), verdict.success, verdict.success_s);
  };
  using End = std::tuple<std::string, std::optional<bool>, std::optional<double>>;
  EXPECT_EQ(end_of(""), End("done", {}, {}));
  EXPECT_EQ(end_of("success(function() return false end)"), End("done", false, {}));
  EXPECT_EQ(end_of("success(function(t, tick) return tick == 0 end)"), End("done", true, 0.0));
  EXPECT_EQ(end_of("success(function(t, tick) return tick == 3 and 0.25 end)"), End("done", true, 0.25));
  EXPECT_EQ(end_of("at(0.15, function() stop('here', true) end)"),
            End("stopped by the script: here", true, 7 * 0.1));
  EXPECT_EQ(end_of("at(0.65, function() stop('here', true) end)"),
            End("stopped by the script: here", true, 8 * 0.1));
  EXPECT_EQ(end_of("at(0.65, function() stop() end)"), End("stopped by the script", {}, {}));
  EXPECT_EQ(end_of("on_finish(function() metric('success', 1) end)"), End("done", true, 1.0));
  EXPECT_EQ(end_of("at(0.65, function() error('broken', 0) end)"), End("verdict.lua:2: broken", {}, {}));
}

TEST(EnvironmentVerdict, SuccessOfTheStartEndsTheFirstStep) {
  EnvironmentOptions options;
  options.experiment = "start.lua";
  options.source =
      "surface { rows = 2, columns = 2 }\nsuccess(function(t, tick) return tick == 0 or tick == 2 end)";
  Environment environment(options);
  for (int episode = 0; episode < 2; ++episode) {
    EXPECT_TRUE(environment.has_succeeded());
    const std::string start = environment.save();
    EXPECT_TRUE(environment.step().terminated);
    EXPECT_EQ(environment.verdict().success_s, 0.0);
    environment.restore(start);
    EXPECT_TRUE(environment.step().terminated);
    environment.reset(7);
  }
}

// Whatever ends the episode besides, and also in another environment that has the state.
TEST(EnvironmentVerdict, TerminatedStaysUntilTheReset) {
  std::mt19937 random(1);
  for (const char* const script :
       {"at(TICK / 10 - 0.05, function() stop('here', true) end)", "at(TICK / 10 - 0.05, quit)",
        "success(function(t, tick) return tick == TICK + 1 end)",
        "success(function(t, tick) return tick == TICK + 1 end) at(TICK / 10 - 0.05, stop)",
        "episode { seconds = 0.1 } at(TICK / 10 - 0.05, stop)"}) {
    SCOPED_TRACE(script);
    const unsigned tick = 1 + random() % 5;
    EnvironmentOptions options;
    options.experiment = "end.lua";
    options.source = "surface { rows = 2, columns = 2 } world { control_period = 1/10, dt = 1/100 } TICK = " +
                     std::to_string(tick) + "\n" + script;
    Environment environment(options), other(options);
    for (int episode = 0; episode < 2; ++episode) {
      for (unsigned step = 1; step <= 8; ++step) {
        const std::string state = environment.save();
        EXPECT_EQ(environment.step().terminated, step > tick) << step;
        other.restore(state);
        EXPECT_EQ(other.step().terminated, step > tick) << step;
      }
      environment.reset(episode);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Experiments, EnvironmentTest,
                         testing::Values(kCrowd, kNoisy, kJoints, kTilting, kDeltas, kTautSkin,
                                         kElasticSkin));

}  // namespace
}  // namespace smartsurf::simulation
