// A controller in the process of its surface: it answers each sensor frame with actuator values, as a process
// at the other end of the shared memory does. The simulator calls it and whoever controls implements it, so
// that neither knows the other.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace common {

struct ControllerChannel {
  std::string name;
  int components = 1;
  double safe_value = 0.0;  // of an actuator channel

  bool operator==(const ControllerChannel&) const = default;
};

// The properties of a surface that a controller knows before the first frame.
struct ControlledSurface {
  int rows = 0, columns = 0;
  double period_s = 0.0;
  std::vector<ControllerChannel> sensors, actuators;

  bool operator==(const ControlledSurface&) const = default;
};

struct SensorFrame {
  std::uint64_t tick = 0;
  double time_s = 0.0;
  // Indexed as ControlledSurface::sensors: [component][row][column], row 0 is north, column 0 is west.
  std::span<const std::span<const float>> channels;
};

enum class ControllerStatus {
  kAnswered,
  kEnded,   // it has left the surface, without an error
  kFailed,  // see Controller::error()
};

// One thread at a time; different controllers are independent.
class Controller {
 public:
  virtual ~Controller() = default;

  // Starts again, as a new controller does, for a new episode.
  virtual void restart() = 0;

  // `targets`, indexed as ControlledSurface::actuators, each rows × columns, holds the values of the previous
  // answer, at first the safe ones; channels that the controller does not command keep them.
  virtual ControllerStatus answer(const SensorFrame&, std::span<const std::span<float>> targets) noexcept = 0;

  // One line.
  virtual std::string error() const = 0;
};

// Called by several threads at once.
class ControllerFactory {
 public:
  virtual ~ControllerFactory() = default;
  // Throws UserError if the controller cannot control this surface.
  virtual std::unique_ptr<Controller> create(const ControlledSurface&) const = 0;
};

// The name of the Python capsule that holds a shared_ptr<const ControllerFactory> for another extension
// module of the same build.
inline constexpr const char* kControllerCapsule = "smartsurf.controller_factory." SMARTSURF_VERSION;

}  // namespace common
