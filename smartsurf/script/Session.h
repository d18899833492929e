// Everything one experiment holds while it lives: what the script declared, its calendar, its random numbers,
// and the simulation it runs in. The bound functions work on this. Internal to the room.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/script/Experiment.h"
#include "smartsurf/script/Interpreter.h"
#include "smartsurf/script/Random.h"
#include "smartsurf/script/Schedule.h"

namespace smartsurf::script {

enum class Phase { kLoading, kRunning };

// A function of the script that waits to be called: where Lua keeps it, and the line that registered it.
struct Callback {
  int reference = LUA_NOREF;
  std::string place;
};

struct Session {
  explicit Session(LoadOptions o) : options(std::move(o)) {}

  LoadOptions options;
  std::filesystem::path folder;  // of the script
  scene::SceneSpec spec;
  Interpreter* interpreter = nullptr;

  Phase phase = Phase::kLoading;
  Host* host = nullptr;  // none while loading
  double time_s = 0.0;
  std::uint64_t tick = 0;

  std::vector<scene::ActuatorSpec> actuators;  // that the script made, whether in use or not
  std::vector<scene::SensorSpec> sensors;      // that the script made, whether in use or not
  std::vector<scene::SensorChannel> channels;  // of the sensors, and the mask of a surface with empty cells

  // Where each was declared ("FILE:LINE"), for the message about a second declaration.
  std::map<std::string, std::string> declared_at;
  // The type of what the script gave back, as a file that is required does; "": nothing.
  std::string returned;

  std::optional<Random> random;  // from its first use on
  std::string random_used_at;

  Schedule schedule;
  std::vector<Callback> callbacks;  // Event::callback is an index here
  std::vector<int> free_callbacks;
  std::vector<int> on_tick, on_leave, on_finish;
  std::vector<std::function<void(Host&)>> at_start;  // pace and pause asked for while loading

  std::vector<std::pair<std::string, double>> metrics;  // in the order in which each was first given

  std::vector<float> targets;  // scratch of cells:targets

  // The generator, seeded at its first use: from then on the seed is settled.
  Random& generator(lua_State* L);
};

// The index of the material that the text at `index` names; throws Problem, naming `name`, when there is
// none.
int material_at(const Session&, lua_State* L, int index, const std::string& name);

// The actuators of surface{} with the names by which its cells choose them. All throw Problem.
struct NamedActuator {
  std::string name;
  scene::ActuatorSpec spec;
};
using NamedActuators = std::vector<NamedActuator>;
NamedActuators one_actuator_at(const Session&, lua_State* L, int index, const std::string& name);
NamedActuators actuators_at(const Session&, lua_State* L, int index, const std::string& name);
// Reads those fields of surface{} that say where its cells stand and what is in each; rows, columns and pitch
// are there.
class Fields;
void read_layout(Session&, lua_State* L, const Fields&, scene::SurfaceSpec&);
// The actuators' part of faults{}.
void read_actuator_faults(lua_State* L, int index, const std::string& name, scene::ActuatorFaultSpec&);

// The sensor, or the list of sensors, at `index`; and the sensors' part of faults{}. Both throw Problem.
void read_sensors(const Session&, lua_State* L, int index, const std::string& name,
                  std::vector<scene::SensorSpec>&);
void read_sensor_faults(lua_State* L, int index, const std::string& name, scene::ParameterValues&);

// Declares the functions of each group as globals. What they do and take: docs/experiments.md.
void bind_declarations(lua_State* L);  // world, material, surface, faults, record
void bind_actuators(lua_State* L);     // one a kind of actuator
void bind_sensors(lua_State* L);       // one a kind of sensor
void bind_options(lua_State* L);       // option, random, math.random
void bind_objects(lua_State* L);       // sphere, box, cylinder, capsule, cone, hull, mesh
void bind_events(lua_State* L);   // at, every, on_tick and the like, time, metric, stop, quit, pause, pace
void bind_handles(lua_State* L);  // object, objects
void bind_cells(lua_State* L);    // cells
// Lua's own libraries, as far as the sandbox lets them in: before the others.
void bind_library(lua_State* L, const Session&);
void bind_pairs(lua_State* L);   // pairs, next, in an order that is the same on every run
void bind_files(lua_State* L);   // require, dofile, io: only beside the script and in the output folder
void bind_denied(lua_State* L);  // os, debug: say what is not there
// Makes an unknown global an error that suggests the nearest name: after the others.
void guard_globals(lua_State* L);

// Throws Problem unless the simulation runs: `what` needs it.
void require_running(const Session&, const std::string& what);
// Throws Problem unless the script is being loaded.
void require_loading(const Session&, const std::string& what);
// Throws Problem where `what` was declared before; notes the place otherwise.
void declare_once(Session&, lua_State* L, const std::string& what);

}  // namespace smartsurf::script
