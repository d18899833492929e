// The functions of FMI 3.0 for co-simulation over smartsurf.h: what the shared object in an FMU exports
// (smartsurf/python/smartsurf/fmu.py, which also writes modelDescription.xml, whose value references stand in
// `Reference`). An FMU's resources hold the script, and a file `start` with the token and the options.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "smartsurf/library/smartsurf.h"

// The types of the standard's headers.
extern "C" {
enum fmi3Status { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal };
using fmi3ValueReference = std::uint32_t;
using fmi3LogMessageCallback = void (*)(void* environment, fmi3Status, const char* category,
                                        const char* message);
}

namespace {

enum Reference : fmi3ValueReference {
  kTime,
  kSeed,
  kTick,
  kReward,
  kTerminated,
  kSuccess,
  kStateHash,
  kPosition = 10,
  kOrientation,
  kVelocity,
  kAngularVelocity,
  kFirstActuator = 100,
  kFirstSensor = 1000
};

// A state that the importer keeps: that of the environment, and the inputs.
struct State {
  std::string bytes;
  std::uint64_t seed;
  std::vector<std::vector<float>> inputs;
  std::vector<bool> set_inputs;
  double time_s;
  smartsurf_result result;
  bool in_step_mode;
};

// The shape of the arrays in modelDescription.xml, which no seed may change.
struct Shape {
  std::int32_t rows = 0, columns = 0;
  std::size_t objects = 0;
  std::vector<std::pair<std::string, std::int32_t>> channels;  // name and components, actuators first
};

void require(smartsurf_status status) {
  if (status != SMARTSURF_OK) throw std::runtime_error(smartsurf_error());
}

class Instance {
 public:
  Instance(std::string resources, const std::string& token, void* environment,
           fmi3LogMessageCallback log_message)
      : resources_(std::move(resources)), environment_(environment), log_(log_message) {
    std::ifstream file(resources_ + "start");
    std::string line;
    if (!std::getline(file, line) || line != token)
      throw std::runtime_error("the instantiation token is not that of modelDescription.xml");
    file >> start_seed_;
    std::getline(file >> std::ws, script_);
    while (std::getline(file, line)) set_.push_back(line);
    load(start_seed_);
  }

  void reset() { load(start_seed_); }
  void leave_initialization_mode() { in_step_mode_ = true; }

  // Inputs that are set stay; the others have the start values of the seed's world.
  void set_seed(std::uint64_t seed) {
    if (in_step_mode_)
      throw std::runtime_error("seed = " + std::to_string(seed) +
                               ": a fixed parameter can be set until the initialization ends only");
    const std::vector<std::vector<float>> inputs = inputs_;
    const std::vector<bool> set = set_inputs_;
    load(seed);
    for (std::size_t i = 0; i < inputs.size(); ++i)
      if (set[i]) inputs_[i] = inputs[i];
    set_inputs_ = set;
  }

  // Takes the steps that end by `until_s`, until one terminates: outputs are those of the latest control
  // period.
  void advance(double until_s) {
    const double period_s = state().period_s;
    const auto ticks = static_cast<std::uint64_t>(std::max(0.0, std::floor(until_s / period_s + 1e-6)));
    while (result_.terminated == 0 && state().tick < ticks) {
      for (std::size_t i = 0; i < inputs_.size(); ++i)
        require(smartsurf_set_targets(table_.get(), i, inputs_[i].data(), inputs_[i].size()));
      result_.size = sizeof result_;
      require(smartsurf_step(table_.get(), &result_));
    }
    time_s_ = until_s;
  }

  State save() {
    const void* bytes = nullptr;
    std::size_t count = 0;
    require(smartsurf_save(table_.get(), &bytes, &count));
    return {std::string(static_cast<const char*>(bytes), count),
            seed_,
            inputs_,
            set_inputs_,
            time_s_,
            result_,
            in_step_mode_};
  }
  void restore(const State& saved) {
    require(smartsurf_restore(table_.get(), saved.bytes.data(), saved.bytes.size()));
    seed_ = saved.seed;
    inputs_ = saved.inputs;
    set_inputs_ = saved.set_inputs;
    time_s_ = saved.time_s;
    result_ = saved.result;
    in_step_mode_ = saved.in_step_mode;
  }

  // Appends the variable's values; throws if it has another type.
  template <class T>
  void read(fmi3ValueReference reference, std::vector<T>& values) const {
    const smartsurf_state now = state();
    if constexpr (std::is_same_v<T, double>) {
      if (reference == kTime) return values.push_back(time_s_);
      if (reference == kReward) return values.push_back(result_.reward);
    } else if constexpr (std::is_same_v<T, std::uint64_t>) {
      if (reference == kSeed) return values.push_back(seed_);
      if (reference == kTick) return values.push_back(now.tick);
      if (reference == kStateHash) return values.push_back(now.hash);
    } else if constexpr (std::is_same_v<T, bool>) {
      if (reference == kTerminated) return values.push_back(result_.terminated != 0);
      if (reference == kSuccess) return values.push_back(result_.success != 0);
    } else {
      if (reference >= kPosition && reference <= kAngularVelocity)
        return read_objects(now, reference, values);
      if (reference >= kFirstSensor &&
          reference - kFirstSensor < smartsurf_channel_count(table_.get(), SMARTSURF_SENSORS)) {
        const smartsurf_channel sensor = channel(SMARTSURF_SENSORS, reference - kFirstSensor);
        values.insert(values.end(), sensor.values, sensor.values + sensor.components * cells());
        return;
      }
      if (reference >= kFirstActuator && reference - kFirstActuator < inputs_.size()) {
        const std::vector<float>& input = inputs_[reference - kFirstActuator];
        values.insert(values.end(), input.begin(), input.end());
        return;
      }
    }
    throw std::runtime_error("no variable of this type has the value reference " + std::to_string(reference));
  }

  std::size_t input_size(fmi3ValueReference reference) const {
    return inputs_[input_index(reference)].size();
  }
  // values: of input_size().
  void set_input(fmi3ValueReference reference, const float* values) {
    const std::size_t index = input_index(reference);
    std::copy_n(values, inputs_[index].size(), inputs_[index].begin());
    set_inputs_[index] = true;
  }

  void log(const char* message) const {
    if (log_ != nullptr) log_(environment_, fmi3Error, "logStatusError", message);
  }

 private:
  using Table = std::unique_ptr<smartsurf_environment, decltype(&smartsurf_destroy)>;

  // Puts a new environment in its initial state. Changes nothing if the seed's world does not fit the unit.
  void load(std::uint64_t seed) {
    std::vector<const char*> set;
    for (const std::string& assignment : set_) set.push_back(assignment.c_str());
    const std::string file = resources_ + script_;
    smartsurf_options options{};
    options.size = sizeof options;
    options.file = file.c_str();
    options.set = set.data();
    options.set_count = set.size();
    options.seed = &seed;
    smartsurf_environment* made = nullptr;
    require(smartsurf_create(&options, &made));
    Table table(made, smartsurf_destroy);
    const Shape shape = shape_of(made);
    if (table_) require_same_shape(seed, shape);
    table_ = std::move(table);
    shape_ = shape;
    seed_ = seed;
    time_s_ = 0;
    result_ = {};
    in_step_mode_ = false;
    inputs_.clear();
    for (std::size_t i = 0; i < smartsurf_channel_count(made, SMARTSURF_ACTUATORS); ++i) {
      const smartsurf_channel actuator = channel(SMARTSURF_ACTUATORS, i);
      inputs_.emplace_back(actuator.values, actuator.values + cells());
    }
    set_inputs_.assign(inputs_.size(), false);
  }

  static Shape shape_of(const smartsurf_environment* table) {
    const smartsurf_state now = state_of(table);
    Shape shape{now.rows, now.columns, now.object_count, {}};
    for (const smartsurf_direction direction : {SMARTSURF_ACTUATORS, SMARTSURF_SENSORS})
      for (std::size_t i = 0; i < smartsurf_channel_count(table, direction); ++i) {
        const smartsurf_channel channel = channel_of(table, direction, i);
        shape.channels.emplace_back(channel.name, channel.components);
      }
    return shape;
  }
  void require_same_shape(std::uint64_t seed, const Shape& shape) const {
    const std::string prefix = "seed = " + std::to_string(seed) + ": its world has ";
    if (shape.objects != shape_.objects)
      throw std::runtime_error(prefix + std::to_string(shape.objects) + " objects: the unit is one of " +
                               std::to_string(shape_.objects));
    if (shape.rows != shape_.rows || shape.columns != shape_.columns || shape.channels != shape_.channels)
      throw std::runtime_error(prefix + "another surface or other channels than the unit");
  }

  std::size_t input_index(fmi3ValueReference reference) const {
    if (reference < kFirstActuator || reference - kFirstActuator >= inputs_.size())
      throw std::runtime_error("the value reference " + std::to_string(reference) + " is not an input");
    return reference - kFirstActuator;
  }

  static smartsurf_state state_of(const smartsurf_environment* table) {
    smartsurf_state now{};
    now.size = sizeof now;
    require(smartsurf_get_state(table, &now));
    return now;
  }
  static smartsurf_channel channel_of(const smartsurf_environment* table, smartsurf_direction direction,
                                      std::size_t index) {
    smartsurf_channel found{};
    found.size = sizeof found;
    require(smartsurf_get_channel(table, direction, index, &found));
    return found;
  }
  smartsurf_state state() const { return state_of(table_.get()); }
  smartsurf_channel channel(smartsurf_direction direction, std::size_t index) const {
    return channel_of(table_.get(), direction, index);
  }
  std::size_t cells() const {
    const smartsurf_state now = state();
    return now.rows * now.columns;
  }

  // Rows of the objects that the experiment starts with, by id; NaN for one that is gone.
  void read_objects(const smartsurf_state& now, fmi3ValueReference reference,
                    std::vector<float>& values) const {
    const float* const sources[] = {now.position, now.orientation, now.velocity, now.angular_velocity};
    const float* const from = sources[reference - kPosition];
    const std::size_t width = reference == kOrientation ? 4 : 3, begin = values.size();
    values.resize(begin + shape_.objects * width, std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < now.object_count; ++i)
      if (now.id[i] < shape_.objects)
        std::copy_n(from + i * width, width, values.begin() + begin + now.id[i] * width);
  }

  std::string resources_, script_;
  std::vector<std::string> set_;
  void* environment_;
  fmi3LogMessageCallback log_;
  std::uint64_t start_seed_ = 0, seed_ = 0;
  Table table_{nullptr, smartsurf_destroy};
  Shape shape_;                             // at the start
  std::vector<std::vector<float>> inputs_;  // of each actuator channel
  std::vector<bool> set_inputs_;            // by the importer
  smartsurf_result result_{};               // of the latest step
  double time_s_ = 0;
  bool in_step_mode_ = false;
};

Instance& of(void* instance) { return *static_cast<Instance*>(instance); }

// Runs the work of a function of the interface: an exception becomes a logged error.
template <class Work>
fmi3Status guarded(void* instance, const Work& work) noexcept {
  try {
    if (instance == nullptr) return fmi3Error;
    work(of(instance));
    return fmi3OK;
  } catch (const std::exception& error) {
    of(instance).log(error.what());
    return fmi3Error;
  }
}

template <class T>
fmi3Status get(void* instance, const fmi3ValueReference* references, std::size_t count, T* values,
               std::size_t value_count) {
  return guarded(instance, [&](const Instance& it) {
    std::vector<T> found;
    for (std::size_t i = 0; i < count; ++i) it.read(references[i], found);
    if (found.size() != value_count)
      throw std::runtime_error("the variables have " + std::to_string(found.size()) + " values, not " +
                               std::to_string(value_count));
    std::copy(found.begin(), found.end(), values);
  });
}

}  // namespace

#define FMI3 extern "C" __attribute__((visibility("default")))

FMI3 const char* fmi3GetVersion() { return "3.0"; }
FMI3 fmi3Status fmi3SetDebugLogging(void*, bool, std::size_t, const char* const*) { return fmi3OK; }

FMI3 void* fmi3InstantiateCoSimulation(const char*, const char* token, const char* resources, bool, bool,
                                       bool, bool, const fmi3ValueReference*, std::size_t, void* environment,
                                       fmi3LogMessageCallback log, void*) {
  try {
    std::string folder = resources != nullptr ? resources : "";
    if (!folder.empty() && folder.back() != '/') folder += '/';
    return new Instance(std::move(folder), token != nullptr ? token : "", environment, log);
  } catch (const std::exception& error) {
    if (log != nullptr) log(environment, fmi3Error, "logStatusError", error.what());
    return nullptr;
  }
}
FMI3 void fmi3FreeInstance(void* instance) { delete static_cast<Instance*>(instance); }

FMI3 fmi3Status fmi3EnterInitializationMode(void* instance, bool, double, double start_s, bool, double) {
  return guarded(instance, [start_s](const Instance&) {
    if (start_s != 0.0)
      throw std::runtime_error("startTime = " + std::to_string(start_s) +
                               ": must be 0: the experiment starts there");
  });
}
FMI3 fmi3Status fmi3ExitInitializationMode(void* instance) {
  return guarded(instance, [](Instance& it) { it.leave_initialization_mode(); });
}
FMI3 fmi3Status fmi3Terminate(void*) { return fmi3OK; }
FMI3 fmi3Status fmi3Reset(void* instance) {
  return guarded(instance, [](Instance& it) { it.reset(); });
}

FMI3 fmi3Status fmi3DoStep(void* instance, double from_s, double step_s, bool, bool* event_needed,
                           bool* terminate, bool* early_return, double* last_time_s) {
  *event_needed = *terminate = *early_return = false;
  return guarded(instance, [&](Instance& it) {
    it.advance(from_s + step_s);
    *last_time_s = from_s + step_s;
  });
}

FMI3 fmi3Status fmi3GetFloat32(void* i, const fmi3ValueReference* r, std::size_t n, float* v, std::size_t m) {
  return get(i, r, n, v, m);
}
FMI3 fmi3Status fmi3GetFloat64(void* i, const fmi3ValueReference* r, std::size_t n, double* v,
                               std::size_t m) {
  return get(i, r, n, v, m);
}
FMI3 fmi3Status fmi3GetUInt64(void* i, const fmi3ValueReference* r, std::size_t n, std::uint64_t* v,
                              std::size_t m) {
  return get(i, r, n, v, m);
}
FMI3 fmi3Status fmi3GetBoolean(void* i, const fmi3ValueReference* r, std::size_t n, bool* v, std::size_t m) {
  return get(i, r, n, v, m);
}
FMI3 fmi3Status fmi3SetFloat32(void* instance, const fmi3ValueReference* references, std::size_t count,
                               const float* values, std::size_t value_count) {
  return guarded(instance, [&](Instance& it) {
    std::size_t expected = 0;
    for (std::size_t i = 0; i < count; ++i) expected += it.input_size(references[i]);
    if (expected != value_count)
      throw std::runtime_error("the inputs have " + std::to_string(expected) + " values, not " +
                               std::to_string(value_count));
    for (std::size_t i = 0; i < count; ++i) {
      it.set_input(references[i], values);
      values += it.input_size(references[i]);
    }
  });
}
FMI3 fmi3Status fmi3SetUInt64(void* instance, const fmi3ValueReference* references, std::size_t count,
                              const std::uint64_t* values, std::size_t value_count) {
  return guarded(instance, [&](Instance& it) {
    for (std::size_t i = 0; i < count; ++i)
      if (references[i] != kSeed) throw std::runtime_error("only the seed can be set");
    if (count == 0 || value_count != count) throw std::runtime_error("the seed is one number");
    it.set_seed(values[value_count - 1]);
  });
}

FMI3 fmi3Status fmi3GetFMUState(void* instance, void** state) {
  return guarded(instance, [&](Instance& it) {
    State saved = it.save();
    if (*state != nullptr)
      *static_cast<State*>(*state) = std::move(saved);
    else
      *state = new State(std::move(saved));
  });
}
FMI3 fmi3Status fmi3SetFMUState(void* instance, void* state) {
  return guarded(instance, [&](Instance& it) { it.restore(*static_cast<const State*>(state)); });
}
FMI3 fmi3Status fmi3FreeFMUState(void*, void** state) {
  delete static_cast<State*>(*state);
  *state = nullptr;
  return fmi3OK;
}

// Functions that the standard wants exported and this FMU's modelDescription.xml denies, whatever their
// arguments.
#define UNSUPPORTED(name) \
  FMI3 fmi3Status name() { return fmi3Error; }
FMI3 void* fmi3InstantiateModelExchange() { return nullptr; }
FMI3 void* fmi3InstantiateScheduledExecution() { return nullptr; }
UNSUPPORTED(fmi3EnterEventMode)
UNSUPPORTED(fmi3GetInt8)
UNSUPPORTED(fmi3GetUInt8)
UNSUPPORTED(fmi3GetInt16)
UNSUPPORTED(fmi3GetUInt16)
UNSUPPORTED(fmi3GetInt32)
UNSUPPORTED(fmi3GetUInt32)
UNSUPPORTED(fmi3GetInt64)
UNSUPPORTED(fmi3GetString)
UNSUPPORTED(fmi3GetBinary)
UNSUPPORTED(fmi3GetClock)
UNSUPPORTED(fmi3SetFloat64)
UNSUPPORTED(fmi3SetInt8)
UNSUPPORTED(fmi3SetUInt8)
UNSUPPORTED(fmi3SetInt16)
UNSUPPORTED(fmi3SetUInt16)
UNSUPPORTED(fmi3SetInt32)
UNSUPPORTED(fmi3SetUInt32)
UNSUPPORTED(fmi3SetInt64)
UNSUPPORTED(fmi3SetBoolean)
UNSUPPORTED(fmi3SetString)
UNSUPPORTED(fmi3SetBinary)
UNSUPPORTED(fmi3SetClock)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies)
UNSUPPORTED(fmi3GetVariableDependencies)
UNSUPPORTED(fmi3SerializedFMUStateSize)
UNSUPPORTED(fmi3SerializeFMUState)
UNSUPPORTED(fmi3DeserializeFMUState)
UNSUPPORTED(fmi3GetDirectionalDerivative)
UNSUPPORTED(fmi3GetAdjointDerivative)
UNSUPPORTED(fmi3EnterConfigurationMode)
UNSUPPORTED(fmi3ExitConfigurationMode)
UNSUPPORTED(fmi3GetIntervalDecimal)
UNSUPPORTED(fmi3GetIntervalFraction)
UNSUPPORTED(fmi3GetShiftDecimal)
UNSUPPORTED(fmi3GetShiftFraction)
UNSUPPORTED(fmi3SetIntervalDecimal)
UNSUPPORTED(fmi3SetIntervalFraction)
UNSUPPORTED(fmi3SetShiftDecimal)
UNSUPPORTED(fmi3SetShiftFraction)
UNSUPPORTED(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3UpdateDiscreteStates)
UNSUPPORTED(fmi3EnterContinuousTimeMode)
UNSUPPORTED(fmi3CompletedIntegratorStep)
UNSUPPORTED(fmi3SetTime)
UNSUPPORTED(fmi3SetContinuousStates)
UNSUPPORTED(fmi3GetContinuousStateDerivatives)
UNSUPPORTED(fmi3GetEventIndicators)
UNSUPPORTED(fmi3GetContinuousStates)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates)
UNSUPPORTED(fmi3GetNumberOfEventIndicators)
UNSUPPORTED(fmi3GetNumberOfContinuousStates)
UNSUPPORTED(fmi3EnterStepMode)
UNSUPPORTED(fmi3GetOutputDerivatives)
UNSUPPORTED(fmi3ActivateModelPartition)
