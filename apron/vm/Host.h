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
  kClosed,       // the surface closed the session in an orderly way: the program ends without an error
  kPeerLost,     // the surface process died
  kInterrupted,  // the user requested a stop
  kRefused,      // invalid user input (no such file or channel, wrong shape); see message()
  kFailed,       // the operation failed (disk full, ...); see message()
};

// A register or a scalar.
struct PluginArgument {
  ConstPlane plane{};  // null data: the argument is the scalar `value`
  float value = 0.0F;
};

// Called on the thread that runs the VM, one call at a time. Planes are valid only during the call. A read
// either fills every cell of a plane of exactly the register's shape or returns kRefused. No call may throw.
class Host {
 public:
  virtual ~Host() = default;

  // The program restarts from its first instruction: frames count from 0, media are closed.
  virtual void restart() {}

  // One line describing the last refused or failed call, without a source location.
  virtual std::string message() const { return {}; }

  virtual void print(std::string_view text) = 0;

  // The value that the user set for a slider or switch, if any.
  virtual std::optional<float> parameter(std::string_view /*name*/) { return std::nullopt; }

  // The code of the oldest key press that was not read yet; 0: none. Codes are those of program/Keys.h.
  virtual int take_key() { return 0; }
  virtual bool key_down(int /*code*/) { return false; }

  // Files, video clips and cameras; refused by default. Frames are grey, 0 to 255.
  virtual HostStatus open_array(std::string_view /*file*/, Plane /*to*/) { return HostStatus::kRefused; }
  virtual HostStatus save_array(std::string_view /*file*/, ConstPlane /*from*/) {
    return HostStatus::kRefused;
  }
  virtual HostStatus open_image(std::string_view /*file*/, Plane /*to*/) { return HostStatus::kRefused; }
  virtual HostStatus save_image(std::string_view /*file*/, ConstPlane /*from*/) {
    return HostStatus::kRefused;
  }
  virtual HostStatus open_clip(std::string_view /*file*/) { return HostStatus::kRefused; }
  virtual HostStatus read_clip(Plane /*to*/) { return HostStatus::kRefused; }
  virtual void close_clip() {}
  // From 0.
  virtual HostStatus open_camera(int /*number*/) { return HostStatus::kRefused; }
  virtual HostStatus read_camera(Plane /*to*/) { return HostStatus::kRefused; }
  virtual void close_camera() {}

  // Windows; no-ops without one. `reg` is the register's name in the program.
  virtual void show(std::string_view /*reg*/, std::string_view /*title*/) {}
  virtual void display(std::string_view /*reg*/, std::string_view /*title*/) {}
  // Arranges the displayed registers in `columns` columns; 0 chooses a layout.
  virtual void tile(int /*columns*/) {}
  // Sets the text of the label called `name`.
  virtual void label(std::string_view /*name*/, std::string_view /*text*/) {}
  virtual void set_palette(std::string_view /*reg*/, std::string_view /*name*/) {}
  virtual void set_scale(std::string_view /*reg*/, float /*low*/, float /*high*/) {}

  // Named wall-clock timers: their values are not a function of the program. A host without a clock reads 0
  // and never waits.
  virtual void start_timer(std::string_view /*name*/) {}
  virtual void stop_timer(std::string_view /*name*/) {}
  virtual void reset_timer(std::string_view /*name*/) {}
  virtual double read_timer_s(std::string_view /*name*/) { return 0.0; }
  virtual HostStatus wait(double /*seconds*/) { return HostStatus::kOk; }

  // Calls operation number `operation` of plugin `module`. `to` holds the destination register's old cells
  // and receives the new ones (null data: no register destination); `value` does the same for a variable
  // (null: none). `to` does not alias any argument.
  virtual HostStatus call_plugin(std::string_view /*module*/, int /*operation*/,
                                 std::span<const PluginArgument> /*arguments*/, Plane /*to*/,
                                 float* /*value*/) {
    return HostStatus::kRefused;
  }

  // Copies the latest frame of a sensor channel. Refused without a surface, as actuate() is.
  virtual HostStatus sense(std::string_view /*channel*/, Plane /*to*/) { return HostStatus::kRefused; }
  // Stages a frame of an actuator channel: one value per cell, or one value for all cells.
  virtual HostStatus actuate(std::string_view /*channel*/, ConstPlane /*from*/) {
    return HostStatus::kRefused;
  }
  virtual HostStatus actuate(std::string_view /*channel*/, float /*value*/) { return HostStatus::kRefused; }
  // Publishes the staged frames, then waits for the next sensor frame. Without a surface: starts the next
  // frame.
  virtual HostStatus step() = 0;
  // If set, step() on a surface that does not wait for the program returns without a new frame.
  virtual void set_free_run(bool /*free_run*/) {}

  // Time, period and number of the latest frame; nullopt in a host without frames.
  virtual std::optional<double> time_s() const = 0;
  virtual std::optional<double> dt_s() const = 0;
  virtual std::optional<double> tick() const = 0;
  virtual bool has(std::string_view channel) const = 0;
};

}  // namespace apron::vm
