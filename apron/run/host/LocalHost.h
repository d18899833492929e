// The VM's host without a surface: console on stdout, media files relative to the current directory, in the
// folders of FileAccess, cameras, frames, parameters and keys from the command line.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "apron/program/Program.h"
#include "apron/run/host/FileAccess.h"
#include "apron/run/host/FrameClock.h"
#include "apron/run/host/KeyScript.h"
#include "apron/run/host/PluginModules.h"
#include "apron/run/host/Timers.h"
#include "apron/run/media/Camera.h"
#include "apron/run/media/Y4mReader.h"
#include "apron/vm/Host.h"

namespace apron::run {

using Parameters = std::map<std::string, float, std::less<>>;

// The cameras, clocks and keys that a program sees.
struct HostEnvironment {
  std::vector<std::string> cameras;  // replace /dev/video0, /dev/video1, …; see run::open_camera()
  Timers::Clock clock_s;             // empty: timers read 0
  FrameRate frame_rate = {};         // without a surface
  std::vector<KeyPress> keys = {};   // scripted
  FileAccess files = {};
};

class LocalHost : public vm::Host {
 public:
  // stop interrupts every wait and must outlive this.
  LocalHost(Parameters parameters, const std::atomic<bool>& stop, HostEnvironment environment = {});

  void restart() override;
  std::string message() const override;
  void print(std::string_view text) override;
  std::optional<float> parameter(std::string_view name) override;

  int take_key() override { return keys_.take(current_frame()); }
  bool key_down(int code) override { return keys_.is_down(code, current_frame()); }

  vm::HostStatus open_array(std::string_view file, vm::Plane to) override;
  vm::HostStatus save_array(std::string_view file, vm::ConstPlane from) override;
  vm::HostStatus open_image(std::string_view file, vm::Plane to) override;
  vm::HostStatus save_image(std::string_view file, vm::ConstPlane from) override;

  vm::HostStatus open_clip(std::string_view file) override;
  vm::HostStatus read_clip(vm::Plane to) override;
  void close_clip() override { clip_.reset(); }
  vm::HostStatus open_camera(int number) override;
  vm::HostStatus read_camera(vm::Plane to) override;
  void close_camera() override { camera_.reset(); }

  void start_timer(std::string_view name) override { timers_.start(name); }
  void stop_timer(std::string_view name) override { timers_.stop(name); }
  void reset_timer(std::string_view name) override { timers_.reset(name); }
  double read_timer_s(std::string_view name) override { return timers_.read_s(name); }
  vm::HostStatus wait(double seconds) override;

  // Loads the program's modules, if they are permitted; call before it runs. Returns an error message with
  // the place that names the module, or empty.
  std::string load_modules(const program::Program&, const std::vector<std::string>& permitted,
                           const std::vector<std::string>& directories);
  vm::HostStatus call_plugin(std::string_view module, int operation,
                             std::span<const vm::PluginArgument> arguments, vm::Plane to,
                             float* value) override;

  // Refused, because there is no surface.
  vm::HostStatus sense(std::string_view channel, vm::Plane to) override;
  vm::HostStatus actuate(std::string_view channel, vm::ConstPlane from) override;
  vm::HostStatus actuate(std::string_view channel, float value) override;
  // Starts the next frame, when it is due.
  vm::HostStatus step() override;
  std::optional<double> time_s() const override { return frames_.time_s(); }
  std::optional<double> dt_s() const override { return frames_.period_s(); }
  std::optional<double> tick() const override { return static_cast<double>(frames_.frame()); }
  bool has(std::string_view) const override { return false; }

  // Called before each answer to the surface, on the VM's thread.
  void before_answer(std::function<void()> action) { before_answer_ = std::move(action); }

  // True if a surface has waited for the program's next surface.step long enough for a warning.
  virtual bool surface_overdue() const { return false; }

 protected:
  // Stores the message for message() and returns the status.
  vm::HostStatus report_status(vm::HostStatus status, std::string message);
  void flush_output();
  const std::atomic<bool>& stop() const { return stop_; }

  void notify_before_answer() const {
    if (before_answer_) before_answer_();
  }

 private:
  std::uint64_t current_frame() const { return static_cast<std::uint64_t>(tick().value_or(0.0)); }
  // The name, if the program may read or write the file. Throw MediaError.
  std::string readable(std::string_view file) const;
  std::string writable(std::string_view file) const;
  template <class Media>
  vm::HostStatus guard_media_errors(const Media& operation);

  Parameters parameters_;
  const std::atomic<bool>& stop_;
  std::string message_;
  std::unique_ptr<Y4mReader> clip_;
  std::vector<std::string> cameras_;
  std::unique_ptr<Camera> camera_;
  Timers timers_;
  FrameClock frames_;
  KeyScript keys_;
  FileAccess files_;
  PluginModules modules_;
  std::function<void()> before_answer_;
};

}  // namespace apron::run
