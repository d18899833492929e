// The host of a program inside another program: it prints where its owner wants, and has no files, cameras,
// keys, modules or clocks.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "apron/library/ProgramSource.h"
#include "apron/vm/Host.h"

namespace apron::library {

class EmbeddedHost : public vm::Host {
 public:
  // `print` must not throw; empty: nothing is printed.
  using Print = std::function<void(std::string_view)>;

  explicit EmbeddedHost(Print print) : print_(std::move(print)) {}

  void set_parameters(ParameterValues values) { parameters_ = std::move(values); }

  std::string message() const override { return message_; }
  void print(std::string_view text) override {
    if (print_) print_(text);
  }
  std::optional<float> parameter(std::string_view name) override;

  vm::HostStatus open_array(std::string_view file, vm::Plane) override { return refuse_file(file); }
  vm::HostStatus save_array(std::string_view file, vm::ConstPlane) override { return refuse_file(file); }
  vm::HostStatus open_image(std::string_view file, vm::Plane) override { return refuse_file(file); }
  vm::HostStatus save_image(std::string_view file, vm::ConstPlane) override { return refuse_file(file); }
  vm::HostStatus open_clip(std::string_view file) override { return refuse_file(file); }
  vm::HostStatus read_clip(vm::Plane) override { return refuse_file(""); }
  vm::HostStatus open_camera(int) override { return refuse("there are no cameras here: use apron run"); }
  vm::HostStatus read_camera(vm::Plane) override { return open_camera(0); }
  vm::HostStatus call_plugin(std::string_view, int, std::span<const vm::PluginArgument>, vm::Plane,
                             float*) override {
    return refuse("native modules are not loaded here: use apron run --module");
  }
  vm::HostStatus sense(std::string_view, vm::Plane) override { return refuse_surface(); }
  vm::HostStatus actuate(std::string_view, vm::ConstPlane) override { return refuse_surface(); }
  vm::HostStatus actuate(std::string_view, float) override { return refuse_surface(); }

 protected:
  vm::HostStatus refuse(std::string message);
  vm::HostStatus refuse_surface() { return refuse("there is no surface here"); }

 private:
  vm::HostStatus refuse_file(std::string_view file);

  Print print_;
  ParameterValues parameters_;
  std::string message_;
};

// Counts frames: surface.step ends one. Their period is 1/30 s, as `apron run` has it.
class FrameCountingHost final : public EmbeddedHost {
 public:
  using EmbeddedHost::EmbeddedHost;

  void restart() override { frame_ = 0; }
  vm::HostStatus step() override {
    ++frame_;
    return vm::HostStatus::kOk;
  }
  std::optional<double> time_s() const override { return static_cast<double>(frame_) / kFramesPerSecond; }
  std::optional<double> dt_s() const override { return 1.0 / kFramesPerSecond; }
  std::optional<double> tick() const override { return static_cast<double>(frame_); }
  bool has(std::string_view) const override { return false; }

 private:
  static constexpr double kFramesPerSecond = 30.0;
  std::uint64_t frame_ = 0;
};

}  // namespace apron::library
