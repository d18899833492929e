// The state of one experiment: its declarations, event queue, random numbers, and the simulation that it runs
// in. Bound functions operate on it. Internal to this module.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/script/EventQueue.h"
#include "smartsurf/script/Experiment.h"
#include "smartsurf/script/Random.h"
#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

enum class Phase { kLoading, kRunning };

// A function of the script that waits to be called: where Lua keeps it, and the line that registered it.
struct Callback {
  int reference = LUA_NOREF;
  std::string location;
};

struct ScriptContext {
  explicit ScriptContext(LoadOptions o) : options(std::move(o)) {}

  LoadOptions options;
  std::filesystem::path script_folder;  // of the script
  scene::SceneSpec spec;
  Interpreter* interpreter = nullptr;

  Phase phase = Phase::kLoading;
  SimulationInterface* simulation = nullptr;  // none while loading
  double time_s = 0.0;
  std::uint64_t tick = 0;

  std::vector<scene::ActuatorSpec> actuators;  // that the script made, whether in use or not
  std::vector<scene::SensorSpec> sensors;      // that the script made, whether in use or not
  std::vector<scene::SensorChannel> channels;  // of the sensors, and the mask of a surface with empty cells

  // Where each was declared ("FILE:LINE"), for the message about a second declaration.
  std::map<std::string, std::string> declared_at;
  // The type of what the script gave back, as a file that is required does; "": nothing.
  std::string returned_type;

  std::optional<Random> random;  // from its first use on
  std::string random_first_use;

  EventQueue event_queue;
  std::vector<Callback> callbacks;  // Event::callback is an index here
  std::vector<int> free_callbacks;
  std::vector<int> on_tick, on_leave, on_finish;
  std::vector<std::function<void(SimulationInterface&)>>
      deferred_requests;  // pace and pause asked for while loading

  std::vector<std::pair<std::string, double>> metrics;  // in the order in which each was first given

  std::vector<float> target_scratch;  // scratch of cells:targets

  // The generator, seeded at its first use: from then on the seed is settled.
  Random& random_generator(lua_State* L);
};

// The index of the material that the text at `index` names; throws Problem, naming `name`, when there is
// none.
int check_material(const ScriptContext&, lua_State* L, int index, const std::string& name);

// The actuators of surface{} with the names by which its cells choose them. All throw Problem.
struct NamedActuator {
  std::string name;
  scene::ActuatorSpec spec;
};
using NamedActuators = std::vector<NamedActuator>;
NamedActuators check_single_actuator(const ScriptContext&, lua_State* L, int index, const std::string& name);
NamedActuators check_actuators(const ScriptContext&, lua_State* L, int index, const std::string& name);
// Reads those fields of surface{} that say where its cells stand and what is in each; rows, columns and pitch
// are there.
class TableReader;
void read_layout(ScriptContext&, lua_State* L, const TableReader&, scene::SurfaceSpec&);
// The actuators' part of faults{}.
void read_actuator_faults(lua_State* L, int index, const std::string& name, scene::ActuatorFaultSpec&);

// The sensor, or the list of sensors, at `index`; and the sensors' part of faults{}. Both throw Problem.
void read_sensors(const ScriptContext&, lua_State* L, int index, const std::string& name,
                  std::vector<scene::SensorSpec>&);
void read_sensor_faults(lua_State* L, int index, const std::string& name, scene::ParameterValues&);

// Declares the functions of each group as globals. What they do and take: docs/experiments.md.
void bind_declarations(lua_State* L);  // world, material, surface, faults, record
void bind_actuators(lua_State* L);     // one a kind of actuator
void bind_sensors(lua_State* L);       // one a kind of sensor
void bind_options(lua_State* L);       // option, random, math.random
void bind_objects(lua_State* L);       // sphere, box, cylinder, capsule, cone, hull, mesh
void bind_events(lua_State* L);  // at, every, on_tick and the like, time, metric, stop, quit, pause, pace
void bind_object_handles(lua_State* L);  // object, objects
void bind_cells(lua_State* L);           // cells
// Lua's own libraries, as far as the sandbox lets them in: before the others.
void bind_standard_library(lua_State* L, const ScriptContext&);
void bind_ordered_pairs(lua_State* L);  // pairs, next, in an order that is the same on every run
void bind_file_access(lua_State* L);  // require, dofile, io: only beside the script and in the output folder
void bind_denied_libraries(lua_State* L);  // os, debug: say what is not there
// Makes an unknown global an error that suggests the nearest name: after the others.
void guard_globals(lua_State* L);

// Throws Problem unless the simulation runs: `what` needs it.
void require_running(const ScriptContext&, const std::string& subject);
// Throws Problem unless the script is being loaded.
void require_loading(const ScriptContext&, const std::string& subject);
// Throws Problem where `what` was declared before; notes the place otherwise.
void declare_once(ScriptContext&, lua_State* L, const std::string& declaration);

}  // namespace smartsurf::script
