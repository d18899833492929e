// The interface of the live page's WebAssembly: one experiment and its program at a time, in one thread.
// Simulation and program take turns as over the shared memory (simulation/ControllerLink.h), so that the
// states are those of the two programs. What both print goes to the standard streams.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apron/library/SurfaceProgram.h"
#include "common/error/UserError.h"
#include "common/text/Printable.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/simulation/Environment.h"
#include "smartsurf/web/SceneJson.h"

namespace {

using nlohmann::json;
using smartsurf::simulation::Environment;
using smartsurf::simulation::EnvironmentOptions;
namespace scene = smartsurf::scene;

constexpr const char* kProgramLibrary = "/apron";  // where the page puts APRON's library

// An array of the frame, and its place there.
struct Series {
  std::string name, unit;
  double low, high;
  std::size_t values;
};

struct Live {
  std::unique_ptr<Environment> environment;
  bool ended = false;
  std::string text;  // of the latest call that returns one
  std::string message;
  std::vector<Series> series;
  std::vector<float> frame;
};

Live& live() {
  static Live instance;
  return instance;
}

const char* give(std::string text) { return (live().text = std::move(text)).c_str(); }

// NAME=VALUE, one a line.
scene::Overrides parse_overrides(std::string_view text) {
  scene::Overrides overrides;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.empty()) continue;
    const std::size_t equals = line.find('=');
    if (equals == line.npos) throw common::UserError("'" + std::string(line) + "': must be NAME=VALUE");
    overrides.emplace_back(line.substr(0, equals), line.substr(equals + 1));
  }
  return overrides;
}

std::optional<std::uint64_t> parse_seed(const std::string& text) {
  if (text.empty()) return std::nullopt;
  constexpr std::size_t kMaxDigits = 19;
  if (text.size() > kMaxDigits || text.find_first_not_of("0123456789") != text.npos)
    throw common::UserError("seed '" + text + "': must be a whole number from 0 to 9999999999999999999");
  return std::stoull(text);
}

// Runs `call` and returns the line of its error, "" without one.
template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
    return "";
  } catch (const std::bad_alloc&) {
    return "out of memory";
  } catch (const std::exception& error) {
    return error.what();
  }
}

void list_series() {
  const scene::SurfaceSpec& surface = live().environment->scene().surface;
  const auto& simulation = live().environment->simulation();
  const scene::Snapshot& snapshot = simulation.snapshot();
  const std::size_t cells = surface.cell_count();
  std::vector<Series>& series = live().series;
  series.clear();
  if (const std::size_t objects = simulation.catalogue().size(); objects > 0) {
    series.push_back({"position", "u", 0.0, 1.0, 3 * objects});
    series.push_back({"orientation", "", -1.0, 1.0, 4 * objects});
  }
  series.push_back({"height", "u", surface.pin.min_height, surface.max_top_height(), cells});
  for (const scene::SensorChannel& channel : scene::collect_channels(surface.sensors))
    if (channel.components == 1)
      series.push_back({"sensors/" + channel.name, channel.unit, channel.minimum, channel.maximum, cells});
  for (const scene::ActuatorChannel& channel : surface.actuator_channels())
    series.push_back({"actuators/" + channel.name, channel.unit, channel.minimum, channel.maximum, cells});
  if (!snapshot.actuator_state.empty()) series.push_back({"motion", "", -1.0, 1.0, 3 * cells});
  if (!snapshot.skin_height.empty()) series.push_back({"skin", "u", 0.0, 1.0, snapshot.skin_height.size()});
}

void append_objects(const smartsurf::simulation::Simulation& simulation, std::vector<float>& frame) {
  const scene::Snapshot& snapshot = simulation.snapshot();
  const std::size_t first = frame.size(), objects = simulation.catalogue().size();
  frame.resize(first + 7 * objects, std::numeric_limits<float>::quiet_NaN());
  float* const positions = frame.data() + first;
  float* const orientations = positions + 3 * objects;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    std::copy(snapshot.position[i].begin(), snapshot.position[i].end(), positions + 3 * snapshot.id[i]);
    std::copy(snapshot.orientation[i].begin(), snapshot.orientation[i].end(),
              orientations + 4 * snapshot.id[i]);
  }
}

// In the order of list_series().
void fill_frame() {
  const auto& simulation = live().environment->simulation();
  const scene::Snapshot& snapshot = simulation.snapshot();
  std::vector<float>& frame = live().frame;
  const auto append = [&](const auto& values) { frame.insert(frame.end(), values.begin(), values.end()); };
  frame.clear();
  append_objects(simulation, frame);
  append(snapshot.height);
  for (const scene::ChannelData& channel : simulation.sensors())
    if (channel.components == 1) append(channel.values);
  for (const scene::ChannelData& channel : simulation.actuators()) append(channel.values);
  for (const scene::ActuatorState& state : snapshot.actuator_state)
    append(std::initializer_list<float>{state.a, state.b, state.level});
  append(snapshot.skin_height);
}

}  // namespace

extern "C" {

// Loads the files and takes the place of what ran before. `program`: "" for a script that moves its actuators
// itself. `seed`: "" for the script's. `overrides`: NAME=VALUE, one a line. Returns "", or the error as the
// programs print it.
const char* live_start(const char* experiment, const char* program, const char* seed, const char* overrides) {
  live().environment.reset();
  live().ended = false;
  live().message.clear();
  return give(error_of([&] {
    EnvironmentOptions options;
    options.experiment = experiment;
    options.seed = parse_seed(seed);
    options.overrides = parse_overrides(overrides);
    if (*program != '\0') {
      apron::library::ProgramSource source;
      source.file = program;
      source.library_path = kProgramLibrary;
      options.controller =
          apron::library::make_controller_factory(std::move(source), {}, common::print_output);
    }
    live().environment = std::make_unique<Environment>(std::move(options));
  }));
}

// Advances by one control period. Returns 0: it goes on; 1: it has ended; 2: it has failed. live_message()
// says why.
int live_tick() {
  if (!live().environment) return 2;
  if (live().ended) return 1;
  int status = 0;
  const std::string error = error_of([&] {
    const smartsurf::simulation::StepResult result = live().environment->step();
    if (!result.terminated && !result.truncated) return;
    status = 1;
    live().message = result.success      ? "success"
                     : result.terminated ? "stopped by the script"
                                         : "the episode is over";
  });
  if (!error.empty()) {
    live().message = error;
    status = 2;
  }
  live().ended = status != 0;
  return status;
}

const char* live_message() { return live().message.c_str(); }

// The parts of a scene that do not change until live_start(), or until live_objects() grows: see SceneJson.h.
// "series" lists the arrays of a frame.
const char* live_scene() {
  const auto& simulation = live().environment->simulation();
  list_series();
  json scene = smartsurf::web::scene_json(simulation.scene(), simulation.catalogue());
  scene["period"] = simulation.scene().world.control_period_s;
  scene["series"] = json::array();
  for (const Series& s : live().series)
    scene["series"].push_back(
        {{"name", s.name}, {"unit", s.unit}, {"low", s.low}, {"high", s.high}, {"values", s.values}});
  return give(scene.dump(-1, ' ', false, json::error_handler_t::replace));
}

// The arrays, one after the other; NaN where there is no value.
const float* live_frame() {
  fill_frame();
  return live().frame.data();
}
int live_frame_size() { return static_cast<int>(live().frame.size()); }

int live_objects() { return static_cast<int>(live().environment->simulation().catalogue().size()); }
double live_time() { return live().environment->simulation().snapshot().time_s; }

// The hash of the state, as `smartsurf run --stats` writes it.
const char* live_hash() {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(live().environment->simulation().snapshot().state_hash));
  return give(text);
}

}  // extern "C"
