// A host decorator: console, labels, sliders and palettes also go to a front panel.
#pragma once

#include "apron/debugger/FrontPanel.h"
#include "apron/vm/Host.h"

namespace apron::debugger {

// Forwards everything else to the inner host, including sliders that the user has not moved. Both must
// outlive this.
class PanelHost final : public vm::Host {
 public:
  PanelHost(vm::Host& inner, FrontPanel& panel) : inner_(inner), panel_(panel) {}

  void restart() override { inner_.restart(); }
  std::string message() const override { return inner_.message(); }
  void print(std::string_view text) override {
    inner_.print(text);
    panel_.print(text);
  }
  std::optional<float> parameter(std::string_view name) override {
    const std::optional<float> set = panel_.parameter(name);
    return set ? set : inner_.parameter(name);
  }
  int take_key() override {
    const int code = panel_.take_key();
    return code != 0 ? code : inner_.take_key();
  }
  bool key_down(int code) override { return panel_.key_down(code) || inner_.key_down(code); }
  vm::HostStatus open_array(std::string_view file, vm::Plane to) override {
    return inner_.open_array(file, to);
  }
  vm::HostStatus save_array(std::string_view file, vm::ConstPlane from) override {
    return inner_.save_array(file, from);
  }
  vm::HostStatus open_image(std::string_view file, vm::Plane to) override {
    return inner_.open_image(file, to);
  }
  vm::HostStatus save_image(std::string_view file, vm::ConstPlane from) override {
    return inner_.save_image(file, from);
  }
  vm::HostStatus open_clip(std::string_view file) override { return inner_.open_clip(file); }
  vm::HostStatus read_clip(vm::Plane to) override { return inner_.read_clip(to); }
  void close_clip() override { inner_.close_clip(); }
  vm::HostStatus open_camera(int number) override { return inner_.open_camera(number); }
  vm::HostStatus read_camera(vm::Plane to) override { return inner_.read_camera(to); }
  void close_camera() override { inner_.close_camera(); }
  void show(std::string_view reg, std::string_view title) override { panel_.show(reg, title); }
  void display(std::string_view reg, std::string_view title) override { panel_.display(reg, title); }
  void tile(int columns) override { panel_.tile(columns); }
  void start_timer(std::string_view name) override { inner_.start_timer(name); }
  void stop_timer(std::string_view name) override { inner_.stop_timer(name); }
  void reset_timer(std::string_view name) override { inner_.reset_timer(name); }
  double read_timer_s(std::string_view name) override { return inner_.read_timer_s(name); }
  vm::HostStatus wait(double seconds) override { return inner_.wait(seconds); }
  void label(std::string_view name, std::string_view text) override { panel_.label(name, text); }
  void set_palette(std::string_view reg, std::string_view name) override { panel_.set_palette(reg, name); }
  void set_scale(std::string_view reg, float low, float high) override { panel_.set_scale(reg, low, high); }
  vm::HostStatus call_plugin(std::string_view module, int operation,
                             std::span<const vm::PluginArgument> arguments, vm::Plane to,
                             float* value) override {
    return inner_.call_plugin(module, operation, arguments, to, value);
  }
  vm::HostStatus sense(std::string_view channel, vm::Plane to) override { return inner_.sense(channel, to); }
  vm::HostStatus actuate(std::string_view channel, vm::ConstPlane from) override {
    return inner_.actuate(channel, from);
  }
  vm::HostStatus actuate(std::string_view channel, float value) override {
    return inner_.actuate(channel, value);
  }
  vm::HostStatus step() override { return inner_.step(); }
  void set_free_run(bool free_run) override { inner_.set_free_run(free_run); }
  std::optional<double> time_s() const override { return inner_.time_s(); }
  std::optional<double> dt_s() const override { return inner_.dt_s(); }
  std::optional<double> tick() const override { return inner_.tick(); }
  bool has(std::string_view channel) const override { return inner_.has(channel); }

 private:
  vm::Host& inner_;
  FrontPanel& panel_;
};

}  // namespace apron::debugger
