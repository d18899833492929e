#include "smartsurf/extension/Extension.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cfenv>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "smartsurf/simulation/Environment.h"
#include "tests/unit/common/AllocationCounter.h"

namespace smartsurf {
namespace {

simulation::Environment make(const std::string& script) {
  extension::load(SMARTSURF_PROBE);
  simulation::EnvironmentOptions options;
  options.experiment = "probe.lua";
  options.source = script;
  return simulation::Environment(std::move(options));
}

std::vector<float> reading(const simulation::Environment& environment, const std::string& channel) {
  for (const scene::ChannelData& data : environment.simulation().sensors())
    if (data.name == channel) return {data.values.begin(), data.values.end()};
  ADD_FAILURE() << "no channel " << channel;
  return {};
}

void lift(simulation::Environment& environment, float height, int ticks) {
  environment.set_targets(0, std::vector<float>(64, height));
  for (int tick = 0; tick < ticks; ++tick) environment.step();
}

float height_of_ball(const simulation::Environment& environment) {
  return environment.simulation().snapshot().position[0][2];
}

TEST(Extension, LoadingItLeavesTheArithmeticAlone) {
  make("surface { rows = 2, columns = 2 }");
  EXPECT_EQ(std::fegetround(), FE_TONEAREST);
}

constexpr const char* kBall = R"(
surface { rows = 8, columns = 8, sensors = { census {} }, actuator = lifter { height = 0 } }
sphere { radius = 1, position = {3.5, 3.5, 1}, label = 'light' }
)";

TEST(Extension, MovesTopsAndLiftsWhatLiesOnThem) {
  simulation::Environment environment = make(kBall);
  lift(environment, 2.0F, 240);
  EXPECT_NEAR(environment.simulation().snapshot().height[9], 2.0F, 1e-4F);
  EXPECT_NEAR(height_of_ball(environment), 3.0F, 0.02F);
  const std::vector<float> force = reading(environment, "census");
  EXPECT_NEAR(std::accumulate(force.begin(), force.end(), 0.0F), 4.0F / 3.0F * 3.14159F * 9.81F, 0.5F);
}

TEST(Extension, RangeOfAChannelFollowsTheParameters) {
  simulation::Environment environment =
      make("surface { rows = 8, columns = 8, actuator = lifter { max_height = 1.5 } }");
  lift(environment, 100.0F, 1);
  EXPECT_EQ(environment.simulation().actuators()[0].values[3], 1.5F);
}

TEST(Extension, ExertsForcesOnLabelledObjects) {
  simulation::Environment environment = make(R"(
    surface { rows = 8, columns = 8, actuator = lifter { push = { force = {0, 0, 50} } } }
    sphere { radius = 1, mass = 1, position = {2, 2, 1}, label = 'heavy' }
    sphere { radius = 1, mass = 1, position = {5, 5, 1}, label = 'light' })");
  lift(environment, 0.0F, 30);
  EXPECT_NEAR(environment.simulation().snapshot().position[0][2], 1.0F, 0.01F);
  EXPECT_NEAR(environment.simulation().snapshot().velocity[1][2], (50.0F - 9.81F) * 0.5F, 0.2F);
}

TEST(Extension, ReadingsAreClampedAndNaNIsReplaced) {
  simulation::Environment environment = make(kBall);
  environment.step();
  const std::vector<float> odd = reading(environment, "census_odd");
  EXPECT_TRUE(std::all_of(odd.begin(), odd.begin() + 64, [](float v) { return v == 0.5F; }));
  EXPECT_TRUE(std::all_of(odd.begin() + 64, odd.end(), [](float v) { return v == 1.0F; }));
  EXPECT_EQ(reading(environment, "census_spheres")[0], 1.0F);
}

TEST(Extension, SavedStateContainsThatOfInstances) {
  const std::string limited = R"(
    surface { rows = 8, columns = 8, sensors = { census {} }, actuator = lifter { steps = 60 } }
    sphere { radius = 1, position = {3.5, 3.5, 1} })";
  simulation::Environment environment = make(limited);
  lift(environment, 3.0F, 10);
  const std::string state = environment.save();
  lift(environment, 3.0F, 20);  // the lifters stop in the 15th tick, 60 steps after the start
  const std::uint64_t hash = environment.simulation().snapshot().state_hash;
  EXPECT_LT(environment.simulation().snapshot().height[0], 0.6F);
  for (int attempt = 0; attempt < 2; ++attempt) {
    environment.restore(state);
    lift(environment, 3.0F, 20);
    EXPECT_EQ(environment.simulation().snapshot().state_hash, hash);
  }
}

TEST(Extension, RestoredSensorsSeeTheRestoredObjects) {
  // What appears at 0.1 s depends on the height of the ball. Both states have two objects.
  simulation::Environment environment = make(R"(
    surface { rows = 8, columns = 8, sensors = { census {}, proximity { range = 20 } }, actuator = lifter {} }
    sphere { radius = 1, position = {3.5, 3.5, 1} }
    at(0.1, function()
      local _, _, z = object(0):position()
      if z > 1.1 then box { size = {7, 7, 1}, position = {3.5, 3.5, 9} } else sphere { radius = 0.4, position = {6, 6, 9} } end
    end))");
  const std::string start = environment.save();
  lift(environment, 0.0F, 8);
  const std::string with_sphere = environment.save();
  const std::vector<float> spheres = reading(environment, "census_spheres"),
                           seen = reading(environment, "proximity");
  environment.restore(start);
  lift(environment, 3.0F, 8);
  EXPECT_EQ(reading(environment, "census_spheres")[0], 1.0F);
  EXPECT_NE(reading(environment, "proximity"), seen);
  environment.restore(with_sphere);
  EXPECT_EQ(spheres[0], 2.0F);
  EXPECT_EQ(reading(environment, "census_spheres"), spheres);
  EXPECT_EQ(reading(environment, "proximity"), seen);
}

#ifdef COUNTS_ALLOCATIONS
// The allocations of some ticks in which the table moves.
std::size_t allocations_of_steps(const std::string& script) {
  simulation::Environment environment = make(script);
  lift(environment, 1.0F, 60);
  const std::vector<float> targets(64, 2.0F);
  environment.set_targets(0, targets);
  const std::size_t before = allocations;
  for (int tick = 0; tick < 20; ++tick) environment.step();
  return allocations - before;
}

TEST(Extension, StepsAllocateNoMoreThanThoseOfBuiltInKinds) {
  EXPECT_LE(allocations_of_steps(kBall), allocations_of_steps(R"(
    surface { rows = 8, columns = 8, sensors = { pressure {} }, actuator = pin { range = {0, 3}, max_speed = 2 } }
    sphere { radius = 1, position = {3.5, 3.5, 1} })"));
}
#endif

// The cells of the presser's outputs lie where nothing touches them.
TEST(Extension, OutputsThatAreNoNumbersEndTheRun) {
  const std::string cell = "probe.lua: failed at tick 1: the actuator of row 2, column 2 gives it ";
  const struct {
    const char* wrong;
    std::string message;
  } cases[] = {
      {"wrong = 0", cell + "a speed that is not finite"},
      {"wrong = 1", cell + "a surface velocity that is not finite"},
      {"wrong = 2", cell + "a surface velocity that is not finite"},
      {"wrong = 3", cell + "a surface spin that is not finite"},
      {"wrong = 4", cell + "a force limit that is not 0 or more"},
      {"wrong = 4, value = -1", cell + "a force limit that is not 0 or more"},
      {"wrong = 5", cell + "a no-load speed that is not finite and greater than 0"},
      {"wrong = 5, value = 0", cell + "a no-load speed that is not finite and greater than 0"},
      {"wrong = 6", cell + "a height that is not finite"},
      {"wrong = 7",
       "probe.lua: failed at tick 1: an actuator exerts a force or a torque that is not finite on object 1"}};
  for (const auto& [wrong, message] : cases) {
    simulation::Environment environment =
        make(std::string("surface { rows = 8, columns = 8, actuator = presser { ") + wrong +
             " } } sphere { radius = 1, position = {5, 5, 9} } sphere { radius = 1, position = {5, 1, 9} }");
    try {
      environment.step();
      ADD_FAILURE() << wrong;
    } catch (const scene::InputError& error) {
      EXPECT_EQ(error.what(), message);
    }
  }
}

TEST(Extension, SpeedsOfTopsThatRestEndTheRun) {
  const std::string surface = "surface { rows = 8, columns = 8, actuator = rester { speed = ";
  make(surface + "0 } }").step();
  try {
    make(surface + "1 } }").step();
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(),
                 "probe.lua: failed at tick 1: the actuator of row 2, column 2 gives it a speed without the "
                 "flag SMARTSURF_MOVES_TOPS");
  }
}

TEST(Extension, OverloadedCellsRestOnTheirLowerStop) {
  for (const char* force : {"0.1", "1e-37", "0"})
    for (const char* speed : {"0", "0.5", "-3"})
      for (const char* z : {"1.01", "3"}) {  // rising cells meet the box on their stop and above it
        const std::string subject = std::string(force) + ", " + speed + ", " + z;
        simulation::Environment environment =
            make(std::string("surface { rows = 8, columns = 8, actuator = presser { height = 0.5, speed = ") +
                 speed + ", force = " + force +
                 " } } box { size = {3, 3, 1}, mass = 10, position = {3.5, 3.5, " + z + "} }");
        for (int tick = 0; tick < 240; ++tick) {
          environment.step();
          ASSERT_GE(std::ranges::min(environment.simulation().snapshot().height), 0.5F) << subject;
        }
        EXPECT_NEAR(height_of_ball(environment), 1.0F, 0.02F) << subject;
      }
}

TEST(Extension, HeightsOutOfRangeNameTheActuatorAndTheField) {
  try {
    make("surface { rows = 8, columns = 8, actuator = presser { highest = 2e6 } }");
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(), "probe.lua:1: presser.max_height = 2000000: must be in [-1000000, 1000000]");
  }
}

TEST(Extension, ErrorsOfInstancesAreReported) {
  try {
    make("surface { rows = 8, columns = 8, actuator = lifter { steps = 13 } }");
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(), "lifter: cannot be created: thirteen steps");
  }
}

TEST(Extension, MessagesBecomePrintableUtf8) {
  try {
    make("surface { rows = 8, columns = 8, sensors = { census { cast = 13 } } }");
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(), "census: cannot be created: ??[31m\xC3\xA9");
  }
}

TEST(Extension, CastsTheRaysThatItHasPrepared) {
  simulation::Environment environment = make(R"(
    surface { rows = 8, columns = 8, sensors = { census { cast = 0 } } }
    sphere { radius = 1, position = {3, 3, 3}, fixed = true })");
  environment.step();
  const std::vector<float> odd = reading(environment, "census_odd");
  EXPECT_NEAR(odd[64 + 4 * 8 + 3], -2.0F / 5, 1e-4F);
  EXPECT_EQ(odd[64], 1.0F);
  try {
    make("surface { rows = 8, columns = 8, sensors = { census { cast = 1 } } }").step();
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(), "census: casts ray 1, but has prepared 1");
  }
}

TEST(Extension, RaysHaveDirectionsOfAnyLength) {
  const std::string script = R"(
    surface { rows = 8, columns = 8, sensors = { census { cast = 0, direction = {-LENGTH, 0, LENGTH} } } }
    sphere { radius = 1, position = {1, 3, 3}, fixed = true })";
  for (const char* length : {"1", "1e-30", "1e-19", "1e19", "1e20"}) {
    std::string text = script;
    for (std::size_t at; (at = text.find("LENGTH")) != std::string::npos;) text.replace(at, 6, length);
    simulation::Environment environment = make(text);
    environment.step();
    const float distance =
        (3.0F - std::sqrt(0.5F)) * std::sqrt(2.0F);  // to the sphere, from the cell at x = 4
    EXPECT_NEAR(reading(environment, "census_odd")[64 + 4 * 8 + 4], -distance / 5, 1e-4F) << length;
  }
}

TEST(Extension, RaysThatAreNoneNameTheExtensionAndTheSensor) {
  const struct {
    std::string ray, message;  // 7777 stands for NaN, 8888 for infinity
  } cases[] = {{"origin = {0, 7777, 0}", "origin = (0, nan, 0): must be finite"},
               {"origin = {8888, 0, 0}", "origin = (inf, 0, 0): must be finite"},
               {"direction = {0, 0, 0}", "direction = (0, 0, 0): must be finite and not 0"},
               {"direction = {0, 7777, 1}", "direction = (0, nan, 1): must be finite and not 0"},
               {"direction = {8888, 0, 1}", "direction = (inf, 0, 1): must be finite and not 0"},
               {"reach = 7777", "range = nan: must be finite and not negative"},
               {"reach = 8888", "range = inf: must be finite and not negative"},
               {"reach = -1", "range = -1: must be finite and not negative"}};
  for (const auto& [ray, message] : cases) {
    try {
      make("surface { rows = 8, columns = 8, sensors = { census { name = 'eye', cast = 0, " + ray + " } } }");
      ADD_FAILURE() << ray;
    } catch (const scene::InputError& error) {
      EXPECT_EQ(error.what(), std::filesystem::path(SMARTSURF_PROBE).filename().string() +
                                  ": sensor 'eye': ray 0: " + message);
    }
  }
  for (const char* ray : {"reach = 1e30", "origin = {1e30, 0, 0}", "origin = {0, 0, -1e30}"}) {
    simulation::Environment environment =
        make(std::string("surface { rows = 8, columns = 8, sensors = { census { cast = 0, ") + ray +
             " } } } sphere { radius = 1, position = {3, 3, 3}, fixed = true }");
    environment.step();
  }
}

TEST(Extension, SizesOfStatesThatCannotBeNameTheExtension) {
  const std::string probe = std::filesystem::path(SMARTSURF_PROBE).filename().string();
  const struct {
    const char* bytes;
    std::string message;
  } cases[] = {{"1e15", "save() returns 1000000000000000 bytes: must be at most 1073741824"},
               {"13", "save() returns 14 bytes, but first 13"}};
  for (const auto& [bytes, message] : cases) {
    simulation::Environment environment = make(
        std::string("surface { rows = 8, columns = 8, sensors = { census { bytes = ") + bytes + " } } }");
    try {
      environment.save();
      ADD_FAILURE() << bytes;
    } catch (const scene::InputError& error) {
      EXPECT_EQ(error.what(), probe + ": sensor 'census': " + message);
    }
  }
}

TEST(Extension, SensorsHaveNoFalseHits) {
  try {
    make("surface { rows = 8, columns = 8, sensors = { census { false_hits = 0.1 } } }");
    FAIL();
  } catch (const scene::InputError& error) {
    EXPECT_STREQ(error.what(),
                 "probe.lua:1: census.false_hits = 0.1: must be 0: the sensor has no false hits, being of an "
                 "extension");
  }
}

}  // namespace
}  // namespace smartsurf
