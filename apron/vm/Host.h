// The VM's interface to its environment: console, media files, parameters and the surface.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::vm {

enum class HostStatus {
  kOk,
  kClosed,       // the surface ended the session in order: the program ends quietly
  kPeerLost,     // the surface died
  kInterrupted,  // the user wants to stop
  kRefused,      // the user's input is wrong: no such file or channel, wrong shape; message() says what
  kFailed,       // it could not be done: disk full, …; message() says what
};

// A register or a number.
struct PluginArgument {
  ConstPlane plane{};  // without cells: a number
  float value = 0.0F;
};

// Called by the VM on the thread that runs it, one call at a time. Planes are valid during the call only;
// reads fill every cell of a plane of exactly the register's shape, or are refused. No call may throw.
class Host {
 public:
  virtual ~Host() = default;

  // One line about the last call that was refused or failed, without a place.
  virtual std::string message() const { return {}; }

  virtual void print(std::string_view text) = 0;

  // The value that the user gave a slider or switch, if any.
  virtual std::optional<float> parameter(std::string_view /*name*/) { return std::nullopt; }

  virtual HostStatus open_array(std::string_view file, Plane to) = 0;
  virtual HostStatus save_array(std::string_view file, ConstPlane from) = 0;
  virtual HostStatus open_image(std::string_view file, Plane to) = 0;
  virtual HostStatus save_image(std::string_view file, ConstPlane from) = 0;

  // Refused unless the host has videos or a camera.
  virtual HostStatus open_clip(std::string_view /*file*/) { return HostStatus::kRefused; }
  virtual HostStatus read_clip(Plane /*to*/) { return HostStatus::kRefused; }
  virtual void close_clip() {}
  virtual HostStatus open_camera(int /*number*/) { return HostStatus::kRefused; }
  virtual HostStatus read_camera(Plane /*to*/) { return HostStatus::kRefused; }
  virtual void close_camera() {}

  // For windows; without one nothing is done. The register's name is that of the program.
  virtual void show(std::string_view /*reg*/, std::string_view /*title*/) {}
  virtual void display(std::string_view /*reg*/, std::string_view /*title*/) {}
  // columns 0: as fits.
  virtual void tile(int /*columns*/) {}
  // Replaces what the label of that name said.
  virtual void label(std::string_view /*name*/, std::string_view /*text*/) {}
  virtual void set_palette(std::string_view /*reg*/, std::string_view /*name*/) {}
  virtual void set_scale(std::string_view /*reg*/, float /*low*/, float /*high*/) {}

  // Timers by name, of wall time: what they say is no function of the program. Without a clock they stand at
  // 0 and nothing waits.
  virtual void start_timer(std::string_view /*name*/) {}
  virtual void stop_timer(std::string_view /*name*/) {}
  virtual void reset_timer(std::string_view /*name*/) {}
  virtual double read_timer_s(std::string_view /*name*/) { return 0.0; }
  virtual HostStatus wait(double /*seconds*/) { return HostStatus::kOk; }

  // An operation of a module: `to` holds the destination's cells and takes the new ones (without cells: there
  // is no such destination), `value` the same for a number (null: none). `to` is none of the arguments.
  virtual HostStatus call_plugin(std::string_view /*module*/, int /*operation*/,
                                 std::span<const PluginArgument> /*arguments*/, Plane /*to*/,
                                 float* /*value*/) {
    return HostStatus::kRefused;
  }

  // Latest frame of a sensor channel.
  virtual HostStatus sense(std::string_view channel, Plane to) = 0;
  // Stage a frame of an actuator channel: a cell each, or one value for all.
  virtual HostStatus actuate(std::string_view channel, ConstPlane from) = 0;
  virtual HostStatus actuate(std::string_view channel, float value) = 0;
  // Publish what was staged, then have the next sensor frame.
  virtual HostStatus step() = 0;

  // Of the latest sensor frame; nothing without a surface.
  virtual std::optional<double> time_s() const = 0;
  virtual std::optional<double> dt_s() const = 0;
  virtual std::optional<double> tick() const = 0;
  virtual bool has(std::string_view channel) const = 0;
};

}  // namespace apron::vm
