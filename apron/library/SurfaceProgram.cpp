#include "apron/library/SurfaceProgram.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "apron/library/ChannelName.h"
#include "apron/vm/Vm.h"
#include "common/error/UserError.h"
#include "common/files/ReadFile.h"

namespace apron::library {

using common::ControllerStatus;
using vm::HostStatus;

namespace {

// Gives the program the frame of the current answer() and takes what it actuates.
class ControlledSurfaceHost final : public EmbeddedHost {
 public:
  ControlledSurfaceHost(const common::ControlledSurface& surface, Print print)
      : EmbeddedHost(std::move(print)),
        sensor_count_(surface.sensors.size()),
        rows_(surface.rows),
        columns_(surface.columns),
        // Rounded to whole nanoseconds, as in the protocol.
        period_s_(static_cast<double>(std::llround(surface.period_s * 1e9)) * 1e-9) {
    const auto add = [&](const common::ControllerChannel& channel, bool is_sensor) {
      channels_.push_back({channel.name, is_sensor, static_cast<std::size_t>(channel.components)});
    };
    for (const common::ControllerChannel& channel : surface.sensors) add(channel, true);
    for (const common::ControllerChannel& channel : surface.actuators) add(channel, false);
  }

  void bind(const common::SensorFrame& frame, std::span<const std::span<float>> targets) noexcept {
    frame_ = &frame;
    targets_ = targets;
  }

  HostStatus sense(std::string_view name, vm::Plane to) override {
    ChannelComponent target;
    if (const HostStatus status = resolve(true, name, &to, target); status != HostStatus::kOk) return status;
    const float* from = frame_->channels[target.channel].data() + target.component * to.cell_count();
    for (std::uint32_t y = 0; y < to.height; ++y, from += to.width) std::copy_n(from, to.width, to.row(y));
    return HostStatus::kOk;
  }
  HostStatus actuate(std::string_view name, vm::ConstPlane from) override {
    ChannelComponent target;
    if (const HostStatus status = resolve(false, name, &from, target); status != HostStatus::kOk)
      return status;
    float* to = targets_[target.channel - sensor_count_].data() + target.component * from.cell_count();
    for (std::uint32_t y = 0; y < from.height; ++y, to += from.width)
      std::copy_n(from.row(y), from.width, to);
    return HostStatus::kOk;
  }
  HostStatus actuate(std::string_view name, float value) override {
    ChannelComponent target;
    const vm::ConstPlane* any_shape = nullptr;
    if (const HostStatus status = resolve(false, name, any_shape, target); status != HostStatus::kOk)
      return status;
    const std::size_t cells = std::size_t(rows_) * columns_;
    std::fill_n(targets_[target.channel - sensor_count_].data() + target.component * cells, cells, value);
    return HostStatus::kOk;
  }
  HostStatus step() override { return HostStatus::kOk; }
  std::optional<double> time_s() const override { return frame_->time_s; }
  std::optional<double> dt_s() const override { return period_s_; }
  std::optional<double> tick() const override { return static_cast<double>(frame_->tick); }
  bool has(std::string_view channel) const override { return has_channel(channels_, channel); }

 private:
  template <class Plane>
  HostStatus resolve(bool is_sensor, std::string_view name, const Plane* shape, ChannelComponent& target) {
    if (std::string error = resolve_channel(channels_, is_sensor, name, target); !error.empty())
      return refuse(std::move(error));
    if (shape == nullptr || (shape->width == columns_ && shape->height == rows_)) return HostStatus::kOk;
    return refuse("channel '" + std::string(name) + "' is " + std::to_string(columns_) + "x" +
                  std::to_string(rows_) + ", but the register is " + vm::format_shape(*shape));
  }

  std::vector<NamedChannel> channels_;
  std::size_t sensor_count_;
  std::uint32_t rows_, columns_;
  double period_s_;
  const common::SensorFrame* frame_ = nullptr;
  std::span<const std::span<float>> targets_;
};

class SurfaceProgram final : public common::Controller {
 public:
  SurfaceProgram(program::Program program, const common::ControlledSurface& surface,
                 const ParameterValues& parameters, EmbeddedHost::Print print)
      : host_(surface, std::move(print)), vm_(std::move(program), vm_options(), host_) {
    host_.set_parameters(parameters);
  }

  void restart() override {
    vm_.restart();
    for (std::size_t r = 0; r < vm_.program().registers.size(); ++r) vm_.fill_register(r, 0.0F);
    error_.clear();
  }

  ControllerStatus answer(const common::SensorFrame& frame,
                          std::span<const std::span<float>> targets) noexcept override {
    host_.bind(frame, targets);
    switch (vm_.run()) {
      case vm::Status::kTick:
        return ControllerStatus::kAnswered;
      case vm::Status::kEnded:
      case vm::Status::kClosed:
        return ControllerStatus::kEnded;
      default:
        error_ = vm_.error();
        return ControllerStatus::kFailed;
    }
  }
  std::string error() const override { return error_; }

 private:
  static vm::VmOptions vm_options() {
    vm::VmOptions options;
    options.fusion.observed.all_named = false;
    options.refuse_endless_ticks = true;
    return options;
  }

  ControlledSurfaceHost host_;
  vm::Vm vm_;
  std::string error_;
};

class ProgramFactory final : public common::ControllerFactory {
 public:
  ProgramFactory(ProgramSource source, ParameterValues parameters, EmbeddedHost::Print print)
      : source_(std::move(source)), parameters_(std::move(parameters)), print_(std::move(print)) {
    if (source_.text) return;
    std::string text;
    if (const std::error_code error = common::read_file(source_.file, common::kMaxTextBytes, text))
      throw common::UserError(source_.file + ": cannot be read: " + error.message());
    source_.text = std::move(text);  // every world runs the same text
  }

  std::unique_ptr<common::Controller> create(const common::ControlledSurface& surface) const override {
    SizedProgram compiled = compile(source_, surface.columns, surface.rows);
    require_parameters(compiled.program, parameters_, source_.file);
    require_no_modules(compiled.program);
    return std::make_unique<SurfaceProgram>(std::move(compiled.program), surface, parameters_, print_);
  }

 private:
  ProgramSource source_;
  ParameterValues parameters_;
  EmbeddedHost::Print print_;
};

}  // namespace

std::shared_ptr<const common::ControllerFactory> make_controller_factory(ProgramSource source,
                                                                         ParameterValues parameters,
                                                                         EmbeddedHost::Print print) {
  return std::make_shared<ProgramFactory>(std::move(source), std::move(parameters), std::move(print));
}

}  // namespace apron::library
