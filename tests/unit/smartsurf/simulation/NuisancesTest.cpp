#include "smartsurf/simulation/Nuisances.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/simulation/Environment.h"

namespace smartsurf::simulation {
namespace {

constexpr std::array<std::string_view, 17> kNuisances{
    "friction",       "rolling_friction", "restitution",  "mass",           "size",
    "pin_speed",      "latency",          "stuck",        "dead",           "weak",
    "weak_gain",      "gravity",          "sensor_noise", "sensor_dropout", "sensor_dead",
    "sensor_latency", "false_hits"};

class Draw {
 public:
  explicit Draw(int seed) : engine_(seed) {}
  int below(int n) { return static_cast<int>(engine_() % n); }
  bool coin() { return below(2) == 0; }
  // In steps that a factor of a power of two keeps exact, in decimal digits too.
  double number(double low, double high) { return low + (high - low) * below(65) / 64.0; }
  template <class... Names>
  std::string any_of(Names... names) {
    return std::vector<std::string>{names...}[below(sizeof...(names))];
  }
  // "name = value, ", or "" in half of the cases.
  std::string maybe(std::string_view name, const std::string& value) {
    return coin() ? fmt::format("{} = {}, ", name, value) : "";
  }

 private:
  std::mt19937 engine_;
};

std::string random_object(Draw& draw, double x, double y) {
  const auto number = [&](double low, double high) { return fmt::format("{}", draw.number(low, high)); };
  std::string fields = draw.any_of("sphere { radius = 0.5, ", "box { size = {1, 0.75, 0.5}, ",
                                   "cylinder { radius = 0.5, height = 0.75, ",
                                   "hull { points = {{0, 0, 0}, {1, 0, 0}, {0, 0.9, 0}, {0.1, 0, 0.8}}, ",
                                   "hull { parts = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.5}}, "
                                   "{{0, 0, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, 0.75}}}, ");
  fields += draw.maybe("friction", number(0.125, 1)) + draw.maybe("mass", number(0.5, 2)) +
            draw.maybe("material", draw.any_of("'ice'", "'felt'")) + draw.maybe("com", "{0.125, 0, 0.0625}") +
            draw.maybe("inertia", "{0.5, 0.75, 0.625}") + draw.maybe("label", draw.any_of("'a'", "'b'")) +
            draw.maybe("angular_velocity", "{0.5, -1, 3}") +
            draw.maybe("orientation", fmt::format("{{ roll = {}, pitch = {}, yaw = {} }}", number(-3, 3),
                                                  number(-1, 1), number(-3, 3)));
  if (draw.below(8) == 0) fields += "fixed = true, ";
  return fields + fmt::format("velocity = {{ {}, {}, -1 }}, position = {{ {}, {}, {} }} }}\n", number(-1, 1),
                              number(-1, 1), x, y, number(0.5, 0.625));
}

constexpr std::string_view kMaterials = R"(
material { name = 'ice', friction = 0.0625, restitution = 0.5 }
material { name = 'felt', friction = 0.75, rolling_friction = 0.125, density = 0.5 }
)";

// Several actuators and sensors of one model, materials, and objects of one label. pin_speed: of the speeds
// drawn.
std::string random_scene(int seed, const std::function<double(double)>& pin_speed = std::identity()) {
  Draw draw(seed);
  const auto number = [&](double low, double high) { return fmt::format("{}", draw.number(low, high)); };
  const auto pin = [&](const std::string& rest) {
    return fmt::format("pin {{ range = {{0, 2}}, max_speed = {}, {} }}", pin_speed(draw.number(1, 8)),
                       draw.maybe("max_acceleration", number(50, 400)) + rest);
  };
  std::string text(kMaterials);
  text += fmt::format("surface {{ rows = 4, columns = 8, material = {},\n", draw.any_of("'ice'", "'felt'"));
  const std::string p = pin(draw.maybe("latency", "1")), q = pin("max_force = 30");
  text += fmt::format(
      "  actuators = {{ p = {}, q = {}, c = conveyor {{ max_speed = {} }}, d = conveyor {{}} }},\n", p, q,
      number(1, 3));
  text += "  cells = { 'ppqqpcqd', 'qqppdpcq' },\n  sensors = { ";
  for (const char* name : {"near", "far"})
    text += fmt::format("proximity {{ name = '{}', range = {}, {} {} {} }}, ", name, number(2, 6),
                        draw.maybe("noise", number(0.0625, 0.25)), draw.maybe("dropout", "0.125"),
                        draw.maybe("latency", "1"));
  text += "pressure {}, pin_height {} } }\n";
  text += fmt::format(
      "faults {{ actuator = {{ stuck = 0.125, weak = {{ fraction = 0.25, gain = 0.5 }}, {} }}, "
      "sensor = {{ {} {} {} }} }}\n",
      draw.maybe("latency", "1"), draw.maybe("noise", number(0.0625, 0.25)), draw.maybe("dead", "0.125"),
      draw.maybe("latency", "2"));
  for (int i = 0; i < 4; ++i) text += random_object(draw, 0.5 + 1.5 * i, 1.0);
  text += "at(0, function() cells:targets('height', { ";
  for (int i = 0; i < 32; ++i) text += number(0, 2) + ", ";
  text += "}) end)\n";
  text += "at(1 / 60, function() " + random_object(draw, 6.5, 1.0) + " end)\n";
  return text;
}

// What an episode computes.
struct Outcome {
  std::uint64_t hash = 0;
  std::vector<float> readings;
  bool operator==(const Outcome&) const = default;
};

EnvironmentOptions options(const std::string& script, const std::string& nuisance = "",
                           const std::string& range = "") {
  EnvironmentOptions options;
  options.experiment = "t.lua";
  options.source = script;
  if (!nuisance.empty()) options.overrides = {{"vary." + nuisance, range}};
  return options;
}

Outcome outcome(const EnvironmentOptions& options, int ticks = 4) {
  Environment environment(options);
  for (int tick = 0; tick < ticks; ++tick) environment.step();
  Outcome result{environment.simulation().snapshot().state_hash,
                 std::vector<float>(environment.observation_size())};
  environment.observe(result.readings);
  return result;
}

TEST(Nuisances, AFactorOfOneChangesNothing) {
  int compared = 0;
  for (int seed = 0; seed < 2; ++seed) {
    const std::string script = random_scene(seed);
    const Outcome expected = outcome(options(script));
    const Environment declared(options(script));
    std::vector<std::string> names = SceneParameter::names(declared.scene());
    std::erase_if(names, [&](const auto& name) { return declared.find_parameter(name).is_per_cell(); });
    names.insert(names.end(), kNuisances.begin(), kNuisances.end());
    for (const std::string& name : names) {
      try {
        EXPECT_EQ(outcome(options(script, name, "1:1:factor")), expected) << name << "\n" << script;
        ++compared;
      } catch (const scene::InputError& error) {
        EXPECT_TRUE(std::string_view(error.what()).find("declares no value") != std::string_view::npos)
            << name << ": " << error.what();
      }
    }
  }
  EXPECT_GT(compared, 140);
}

TEST(Nuisances, ChangeEachActuatorOfAModel) {
  for (int seed = 0; seed < 3; ++seed) {
    const std::string script = random_scene(seed);
    for (const auto& [range, change] : std::vector<std::pair<std::string, std::function<double(double)>>>{
             {"0.5:0.5:factor", [](double speed) { return speed * 0.5; }},
             {"2:2:offset", [](double speed) { return speed + 2.0; }},
             {"3", [](double) { return 3.0; }}})
      EXPECT_EQ(outcome(options(script, "actuator.pin.max_speed", range)),
                outcome(options(random_scene(seed, change))))
          << range << "\n"
          << script;
    std::vector<double> speeds;
    random_scene(seed, [&](double speed) { return speeds.emplace_back(speed); });
    const Environment environment(options(script));
    EXPECT_EQ(environment.parameter(environment.find_parameter("actuator.pin.max_speed")), speeds);
    // One pin has no limit of its force, and so none after a factor.
    EXPECT_NE(outcome(options(script, "actuator.pin.max_force", "0.01:0.01:factor")),
              outcome(options(script)));
  }
}

TEST(Nuisances, HoldForDeclaredAndLaterObjectsAlike) {
  std::map<std::string, int> effects;
  for (int seed = 0; seed < 8; ++seed) {
    Draw draw(seed);
    const std::string object = random_object(draw, 1.5, 1.0),
                      scene =
                          std::string(kMaterials) + "surface { rows = 3, columns = 4, material = 'ice' }\n";
    const std::string declared = scene + object, later = scene + "at(0, function() " + object + " end)";
    constexpr int kTicks = 40;
    const Outcome unchanged = outcome(options(declared), kTicks);
    EXPECT_EQ(outcome(options(later), kTicks), unchanged) << object;
    for (const char* name : {"friction", "rolling_friction", "restitution", "mass", "size"})
      for (const char* range : {"0.5:0.5:factor", "0.25:0.25:offset", "0.875"}) {
        if (std::string_view(name) == "size" && !std::string_view(range).ends_with("factor")) continue;
        const Outcome expected = outcome(options(declared, name, range), kTicks);
        EXPECT_EQ(outcome(options(later, name, range), kTicks), expected) << name << " = " << range << "\n"
                                                                          << object;
        if (expected != unchanged) ++effects[name];
      }
  }
  EXPECT_EQ(effects.size(), 5U);
}

}  // namespace
}  // namespace smartsurf::simulation
