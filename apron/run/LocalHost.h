// The VM's host on this machine, without a surface: console on stdout, media files relative to the current
// directory, parameters from the command line.
#pragma once

#include <map>
#include <string>

#include "apron/vm/Host.h"

namespace apron::run {

using Parameters = std::map<std::string, float, std::less<>>;

class LocalHost : public vm::Host {
 public:
  explicit LocalHost(Parameters parameters) : parameters_(std::move(parameters)) {}

  std::string message() const override;
  void print(std::string_view text) override;
  std::optional<float> parameter(std::string_view name) override;

  vm::HostStatus open_array(std::string_view file, vm::Plane to) override;
  vm::HostStatus save_array(std::string_view file, vm::ConstPlane from) override;
  vm::HostStatus open_image(std::string_view file, vm::Plane to) override;
  vm::HostStatus save_image(std::string_view file, vm::ConstPlane from) override;

  // All refused: there is no surface.
  vm::HostStatus sense(std::string_view channel, vm::Plane to) override;
  vm::HostStatus actuate(std::string_view channel, vm::ConstPlane from) override;
  vm::HostStatus actuate(std::string_view channel, float value) override;
  vm::HostStatus step() override;
  std::optional<double> time_s() const override { return std::nullopt; }
  std::optional<double> dt_s() const override { return std::nullopt; }
  std::optional<double> tick() const override { return std::nullopt; }
  bool has(std::string_view) const override { return false; }

 protected:
  vm::HostStatus report(vm::HostStatus status, std::string message);
  // Makes what was printed visible.
  void flush();

 private:
  template <class Media>
  vm::HostStatus media(const Media& work);

  Parameters parameters_;
  std::string message_;
};

}  // namespace apron::run
