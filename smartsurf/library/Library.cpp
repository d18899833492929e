// The functions of smartsurf.h, over simulation::Environment.
#include <algorithm>
#include <cstring>
#include <exception>
#include <string>

#include "common/arithmetic/StandardArithmetic.h"
#include "common/text/ClassicLocale.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/library/smartsurf.h"
#include "smartsurf/simulation/Environment.h"

using smartsurf::simulation::Environment;

struct smartsurf_environment {
  explicit smartsurf_environment(smartsurf::simulation::EnvironmentOptions options)
      : environment(std::move(options)) {
    collect_channels();
  }
  // Call after what may load the script again: its surface may depend on the seed.
  void collect_channels() {
    const smartsurf::scene::SurfaceSpec& surface = environment.scene().surface;
    sensors = surface.observed_channels();
    actuators = surface.actuator_channels();
  }
  Environment environment;
  std::vector<smartsurf::scene::SensorChannel> sensors;
  std::vector<smartsurf::scene::ActuatorChannel> actuators;
  std::string saved;
};

namespace {

thread_local std::string last_error;

// Runs a function of the interface: its exceptions become a status.
template <class Work>
smartsurf_status guarded(const Work& work) noexcept {
  const common::ClassicLocale locale;
  const common::StandardArithmetic arithmetic;
  try {
    work();
    return SMARTSURF_OK;
  } catch (const common::UserError& error) {
    last_error = common::printable(error.what());
    return SMARTSURF_INVALID;
  } catch (const std::exception& error) {
    last_error = common::printable(error.what());
    return SMARTSURF_FAILED;
  }
}

[[noreturn]] void refuse(const std::string& why) { throw common::UserError(why); }

void require(const void* given, const char* name) {
  if (given == nullptr) refuse(std::string(name) + ": is null");
}

// The caller's struct as this version knows it; members that the caller's version lacks are 0.
template <class Struct>
Struct read(const Struct* given, const char* name) {
  require(given, name);
  if (given->size < sizeof given->size || given->size > 4096)
    refuse(std::string(name) + ".size = " + std::to_string(given->size) + ": must be sizeof the struct");
  Struct known{};
  std::memcpy(static_cast<void*>(&known), given, std::min(given->size, sizeof known));
  return known;
}

// Writes the members that the caller's version knows.
template <class Struct>
void write(Struct known, Struct* wanted, const char* name) {
  known.size = read(wanted, name).size;
  std::memcpy(static_cast<void*>(wanted), &known, std::min(known.size, sizeof known));
}

template <class Rows>
const float* flat(const Rows& rows) {
  return rows.empty() ? nullptr : rows.front().data();
}

}  // namespace

const char* smartsurf_version(void) { return SMARTSURF_VERSION; }

const char* smartsurf_error(void) { return last_error.c_str(); }

smartsurf_status smartsurf_load_extension(const char* path) {
  return guarded([&] {
    require(path, "path");
    smartsurf::extension::load(path);
  });
}

smartsurf_status smartsurf_create(const smartsurf_options* given, smartsurf_environment** environment) {
  return guarded([&] {
    require(environment, "environment");
    *environment = nullptr;
    const smartsurf_options known = read(given, "options");
    require(known.file, "options.file");
    if (known.threads < 0 || known.threads > 1024)
      refuse("options.threads = " + std::to_string(known.threads) + ": must be 1 to 1024");
    smartsurf::simulation::EnvironmentOptions options;
    options.experiment = known.file;
    if (known.text != nullptr) options.source = known.text;
    if (known.set_count > 0) require(known.set, "options.set");
    for (std::size_t i = 0; i < known.set_count; ++i) {
      if (known.set[i] == nullptr) refuse("options.set[" + std::to_string(i) + "]: is null");
      const std::string assignment = known.set[i];
      const std::size_t equals = assignment.find('=');
      if (equals == std::string::npos) refuse("options.set: '" + assignment + "': must be NAME=VALUE");
      options.overrides.emplace_back(assignment.substr(0, equals), assignment.substr(equals + 1));
    }
    if (known.seed != nullptr) options.seed = *known.seed;
    if (known.engine != nullptr) options.engine = known.engine;
    options.threads = std::max(known.threads, 1);
    *environment = new smartsurf_environment(std::move(options));
  });
}

void smartsurf_destroy(smartsurf_environment* environment) { delete environment; }

smartsurf_status smartsurf_step(smartsurf_environment* e, smartsurf_result* result) {
  return guarded([&] {
    require(e, "environment");
    if (result != nullptr) read(result, "result");  // before the step, which cannot be undone
    const auto [reward, terminated, truncated, success] = e->environment.step();
    if (result != nullptr) write({0, reward, terminated, truncated, success}, result, "result");
  });
}

smartsurf_status smartsurf_reset(smartsurf_environment* e, uint64_t seed) {
  return guarded([&] {
    require(e, "environment");
    e->environment.reset(seed);
    e->collect_channels();
  });
}

smartsurf_status smartsurf_save(smartsurf_environment* e, const void** bytes, size_t* count) {
  return guarded([&] {
    require(e, "environment"), require(bytes, "bytes"), require(count, "count");
    e->saved = e->environment.save();
    *bytes = e->saved.data();
    *count = e->saved.size();
  });
}

smartsurf_status smartsurf_restore(smartsurf_environment* e, const void* bytes, size_t count) {
  return guarded([&] {
    require(e, "environment"), require(bytes, "bytes");
    e->environment.restore({static_cast<const char*>(bytes), count});
    e->collect_channels();
  });
}

size_t smartsurf_channel_count(const smartsurf_environment* e, smartsurf_direction direction) {
  if (e == nullptr) return 0;
  switch (direction) {
    case SMARTSURF_SENSORS:
      return e->sensors.size();
    case SMARTSURF_ACTUATORS:
      return e->actuators.size();
  }
  return 0;
}

smartsurf_status smartsurf_get_channel(const smartsurf_environment* e, smartsurf_direction direction,
                                       size_t index, smartsurf_channel* channel) {
  return guarded([&] {
    require(e, "environment");
    if (direction != SMARTSURF_SENSORS && direction != SMARTSURF_ACTUATORS)
      refuse("direction = " + std::to_string(direction) +
             ": must be SMARTSURF_SENSORS or SMARTSURF_ACTUATORS");
    if (index >= smartsurf_channel_count(e, direction))
      refuse("index = " + std::to_string(index) + ": there are " +
             std::to_string(smartsurf_channel_count(e, direction)) + " channels");
    const smartsurf::simulation::Simulation& simulation = e->environment.simulation();
    const auto describe = [&](const auto& c, int components, std::span<const float> values) {
      write({0, c.name.c_str(), c.unit.c_str(), c.minimum, c.maximum, components, values.data()}, channel,
            "channel");
    };
    if (direction == SMARTSURF_SENSORS)
      describe(e->sensors[index], e->sensors[index].components,
               index < simulation.sensors().size() ? simulation.sensors()[index].values
                                                   : e->environment.occupancy());
    else
      describe(e->actuators[index], 1, simulation.actuators()[index].values);
  });
}

smartsurf_status smartsurf_set_targets(smartsurf_environment* e, size_t index, const float* targets,
                                       size_t count) {
  return guarded([&] {
    require(e, "environment"), require(targets, "targets");
    if (index >= e->actuators.size())
      refuse("index = " + std::to_string(index) + ": there are " + std::to_string(e->actuators.size()) +
             " channels");
    const std::size_t cells = e->environment.scene().surface.cell_count();
    if (count != cells)
      refuse("count = " + std::to_string(count) + ": must be rows × columns = " + std::to_string(cells));
    e->environment.set_targets(static_cast<int>(index), {targets, count});
  });
}

smartsurf_status smartsurf_get_state(const smartsurf_environment* e, smartsurf_state* state) {
  return guarded([&] {
    require(e, "environment");
    const smartsurf::scene::SceneSpec& scene = e->environment.scene();
    const smartsurf::scene::Snapshot& snapshot = e->environment.simulation().snapshot();
    write({.size = 0,
           .rows = scene.surface.rows,
           .columns = scene.surface.columns,
           .pitch = scene.surface.pitch,
           .period_s = scene.world.control_period_s,
           .seed = scene.world.seed,
           .tick = snapshot.tick,
           .time_s = snapshot.time_s,
           .hash = snapshot.state_hash,
           .height = snapshot.height.data(),
           .object_count = snapshot.object_count(),
           .id = snapshot.id.data(),
           .position = flat(snapshot.position),
           .orientation = flat(snapshot.orientation),
           .velocity = flat(snapshot.velocity),
           .angular_velocity = flat(snapshot.angular_velocity)},
          state, "state");
  });
}
