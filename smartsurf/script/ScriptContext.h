// The state of one experiment, on which all bound functions operate: declarations, event queue, random
// numbers and the simulation. Internal to this module.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Variation.h"
#include "smartsurf/script/EventQueue.h"
#include "smartsurf/script/Random.h"
#include "smartsurf/script/SimulationInterface.h"
#include "smartsurf/script/lua/Interpreter.h"
#include "smartsurf/script/lua/ScriptState.h"

namespace smartsurf::script {

enum class Phase { kLoading, kRunning };

// The purpose of random numbers; each has a stream of its own.
enum class Purpose : std::size_t { kLoad, kReset, kStep };

// A value of info{}: the state of an object, or what a function returns.
struct InfoField {
  std::string name;
  std::optional<scene::ObjectId> object;
  int callback = -1;  // index into ScriptContext::callbacks, without an object
};

struct ScriptContext : Sandbox {
  explicit ScriptContext(LoadOptions load_options) { options = std::move(load_options); }

  scene::SceneSpec spec;
  std::vector<scene::Variation> vary;

  Phase phase = Phase::kLoading;
  SimulationInterface* simulation = nullptr;  // null while loading
  double time_s = 0.0;
  std::uint64_t tick = 0;

  std::vector<scene::ActuatorSpec> actuators;  // all that the script created, used or not
  std::vector<scene::SensorSpec> sensors;      // all that the script created, used or not
  std::vector<scene::SensorChannel> channels;  // of the sensors, and the occupancy mask if cells are empty

  // Declaration -> "FILE:LINE", for the error message about a second declaration.
  std::map<std::string, std::string> declared_at;
  // The Lua type of the script's return value; "" = none. A script that returns a value is probably a module.
  std::string returned_type;

  // The streams of random numbers, by purpose and by name, created at their first use. The seed names world
  // and episode.
  std::array<std::optional<Random>, 3> random;
  std::vector<std::pair<std::string, Random>> named_random;
  std::string random_first_use;  // "FILE:LINE"
  bool resetting = false;        // on_reset is running
  // The function that observes the state, while it runs: reward, success, info{} or metric(). Nothing else
  // may depend on whether, or how often, it is called: each call draws from streams of the seed, the name and
  // the tick.
  struct Observer {
    std::string_view kind;
    std::string name;
    std::optional<Random> random;
    std::vector<std::pair<std::string, Random>> named_random;
  };
  std::optional<Observer> observer;

  EventQueue event_queue;
  std::vector<int> on_tick, on_leave, on_finish, on_reset;  // indices into `callbacks`
  std::optional<int> reward, success;                       // likewise
  std::vector<InfoField> info;                              // by name, within one info{}
  std::optional<double> episode_s;
  // Calls of pace and pause while loading; run by Experiment::start.
  std::vector<std::function<void(SimulationInterface&)>> deferred_requests;

  scene::Metrics metrics;  // in order of first use
  struct MetricFunction {
    std::ptrdiff_t metric;  // index into `metrics`
    int callback;
  };
  std::vector<MetricFunction> metric_functions;

  ScriptState state;
  common::StateArchive* archive = nullptr;  // while the state is saved or restored

  std::vector<float> target_scratch;  // for cells:targets

  // The stream of what the script is doing, or the one with that name, seeded at its first use. A later
  // world.seed must not differ.
  Random& random_stream(lua_State* L);
  Random& random_stream(lua_State* L, const std::string& name);
  Random observer_stream(const std::string& purpose) const;  // of the call of `observer`
  bool has_drawn() const { return !random_first_use.empty(); }
};

// In all functions below, `name` is the dotted name that error messages start with.

// The unit named by the string at `index`. Throws ScriptError if there is none of that name.
scene::PhysicalUnit check_physical_unit(lua_State* L, int index, const std::string& name);

// The index of the material named by the string at `index`. Throws ScriptError if it does not exist.
int check_material(const ScriptContext&, lua_State* L, int index, const std::string& name);

// The actuators of surface{} with the names by which its cells refer to them. All throw ScriptError.
struct NamedActuator {
  std::string name;
  scene::ActuatorSpec spec;
};
using NamedActuators = std::vector<NamedActuator>;
NamedActuators check_single_actuator(const ScriptContext&, lua_State* L, int index, const std::string& name);
NamedActuators check_actuators(const ScriptContext&, lua_State* L, int index, const std::string& name);
class TableReader;
// Stores the function at `index`. Returns its index in ScriptContext::callbacks. Throws ScriptError, which
// begins with `subject`, for any other value.
int store_callback(ScriptContext&, lua_State* L, int index, const std::string& subject);

// Reads the fields of surface{} that define the positions of the cells and the actuator in each. Requires
// that rows, columns and pitch have been read.
void read_layout(ScriptContext&, lua_State* L, const TableReader&, scene::SurfaceSpec&);
// Reads faults.actuator.
void read_actuator_faults(lua_State* L, int index, const std::string& name, scene::ActuatorFaultSpec&);

// Reads the sensor or list of sensors at `index`, and the sensor part of faults{}. Both throw ScriptError.
void read_sensors(const ScriptContext&, lua_State* L, int index, const std::string& name,
                  std::vector<scene::SensorSpec>&);
void read_sensor_faults(lua_State* L, int index, const std::string& name, scene::ParameterValues&);

// Register the functions of each group as globals. docs/experiments.md is their reference.
void bind_declarations(lua_State* L);  // world, material, surface, faults, record
// One function per kind of actuator, or of sensor, that the extension adds; "": that is built in.
void bind_actuators(lua_State* L, const std::string& extension);
void bind_sensors(lua_State* L, const std::string& extension);
void bind_extensions(lua_State* L);      // extension
void bind_options(lua_State* L);         // option, vary, random, random_stream, math.random
void bind_objects(lua_State* L);         // sphere, box, cylinder, capsule, cone, hull, mesh
void bind_events(lua_State* L);          // at, every, on_*, time, metric, stop, quit, pause, pace
void bind_episodes(lua_State* L);        // reward, success, info, episode, on_reset
void bind_object_handles(lua_State* L);  // object, objects
void bind_joints(lua_State* L);          // joint
void bind_models(lua_State* L);          // urdf, mjcf
void bind_cells(lua_State* L);           // cells
// The actuators and sensors of the extensions that the program has loaded. Must run after
// ScriptState::number_library(), so that a script's numbering does not depend on whether the program or the
// script has loaded them.
int bind_loaded_extensions(ScriptContext&, lua_State* L);
// Sets the global `name` to the function that declares an actuator or a sensor. Throws ScriptError if a kind
// of an extension has the name of a function that exists.
void bind_kind(lua_State* L, const std::string& name, lua_CFunction declare, const std::string& extension);

// Throws ScriptError that begins with `subject` unless the simulation is running.
void require_running(const ScriptContext&, const std::string& subject);
// Throws ScriptError that begins with `subject` unless the script is loading.
void require_loading(const ScriptContext&, const std::string& subject);
// Throws ScriptError if `declaration` was made before; records its location otherwise. Messages show `shown`.
void declare_once(ScriptContext&, lua_State* L, const std::string& declaration);
void declare_once(ScriptContext&, lua_State* L, const std::string& declaration, const std::string& shown);

}  // namespace smartsurf::script
