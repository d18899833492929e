// The VM's instructions that call the host.
#include <cassert>
#include <cmath>
#include <string>

#include "apron/vm/NumberText.h"
#include "apron/vm/Vm.h"

namespace apron::vm {

using program::Opcode;

namespace {

constexpr float kMostColumns = 64.0F;  // of tiles

// The name of picture n of a sequence: n in place of the '#'s, with at least as many digits; without any,
// before the ending.
std::string numbered(std::string_view name, float n) {
  std::string digits(number_text(n));
  std::size_t first = name.find('#');
  std::size_t last = first;
  if (first == std::string_view::npos) {
    first = name.find_last_of("./");
    if (first == std::string_view::npos || name[first] == '/') first = name.size();
    last = first;
  } else {
    while (last < name.size() && name[last] == '#') ++last;
  }
  if (digits.size() < last - first) digits.insert(0, last - first - digits.size(), '0');
  return std::string(name.substr(0, first)) + digits + std::string(name.substr(last));
}

}  // namespace

Status Vm::host_call(const Step& step) {
  switch (step.op) {
    case Opcode::kPrintText:
      host_.print(step.text);
      return Status::kBudget;
    case Opcode::kPrintLine:
      host_.print("\n");
      return Status::kBudget;
    case Opcode::kPrintValue:
      print_value(step);
      return Status::kBudget;
    case Opcode::kParameter:
      *step.variable = host_.parameter(step.text).value_or(step.initial);
      return Status::kBudget;
    case Opcode::kArrayOpen:
    case Opcode::kImageOpen:
    case Opcode::kImageOpenCount:
    case Opcode::kClipRead:
    case Opcode::kWebcamRead:
    case Opcode::kSurfaceSense:
      return read_plane(step);
    case Opcode::kImageSaveCount:
      return save_numbered(step);
    case Opcode::kClipOpen:
      return outcome(host_.open_clip(step.text));
    case Opcode::kClipClose:
      host_.close_clip();
      return Status::kBudget;
    case Opcode::kWebcamOpen: {
      const float number = *step.scalars[0];
      return outcome(host_.open_camera(number >= 0.0F && number < 1e6F ? static_cast<int>(number) : -1));
    }
    case Opcode::kWebcamClose:
      host_.close_camera();
      return Status::kBudget;
    case Opcode::kShow:
      host_.show(register_name(step), step.text);
      return Status::kBudget;
    case Opcode::kDisplay:
      host_.display(register_name(step), step.text);
      return Status::kBudget;
    case Opcode::kTile: {
      const float columns = *step.scalars[0];
      host_.tile(columns >= 1.0F ? static_cast<int>(std::fmin(columns, kMostColumns)) : 0);
      return Status::kBudget;
    }
    case Opcode::kTimerStart:
      host_.start_timer(step.text);
      return Status::kBudget;
    case Opcode::kTimerStop:
      host_.stop_timer(step.text);
      return Status::kBudget;
    case Opcode::kTimerReset:
      host_.reset_timer(step.text);
      return Status::kBudget;
    case Opcode::kTimerRead:
      *step.variable = static_cast<float>(host_.read_timer_s(step.text));
      return Status::kBudget;
    case Opcode::kTimerWait:
      return outcome(host_.wait(*step.scalars[0]));
    case Opcode::kLabel: {
      NumberBuffer buffer;
      host_.label(step.text, number_text(*step.scalars[1], buffer));
      return Status::kBudget;
    }
    case Opcode::kLabelText: {
      const program::Instruction& label = program_.code[static_cast<std::size_t>(&step - steps_.data())];
      host_.label(program_.texts[label.operands[0].index], program_.texts[label.operands[1].index]);
      return Status::kBudget;
    }
    case Opcode::kSetPalette:
      host_.set_palette(register_name(step), step.text);
      return Status::kBudget;
    case Opcode::kSetScale:
      host_.set_scale(register_name(step), *step.scalars[1], *step.scalars[2]);
      return Status::kBudget;
    case Opcode::kPluginWith:
      return plugin_with(step);
    case Opcode::kPlugin:
    case Opcode::kPluginDo:
      return plugin(step);
    case Opcode::kArraySave:
      return outcome(host_.save_array(step.text, *step.planes[0]));
    case Opcode::kImageSave:
      return outcome(host_.save_image(step.text, *step.planes[0]));
    case Opcode::kSurfaceActuate:
      return outcome(step.scalars[1] != nullptr ? host_.actuate(step.text, *step.scalars[1])
                                                : host_.actuate(step.text, *step.planes[1]));
    case Opcode::kSurfaceStep: {
      const HostStatus status = host_.step();
      return status == HostStatus::kOk ? Status::kTick : outcome(status);
    }
    case Opcode::kSurfaceTime:
      return surface_value(step, host_.time_s());
    case Opcode::kSurfaceDt:
      return surface_value(step, host_.dt_s());
    case Opcode::kSurfaceTick:
      return surface_value(step, host_.tick());
    case Opcode::kSurfaceHas:
      *step.variable = host_.has(step.text) ? 1.0F : 0.0F;
      return Status::kBudget;
    default:
      assert(false && "an opcode without an action");
      return Status::kFailed;
  }
}

Status Vm::read_plane(const Step& step) {
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open == Gate::kMismatch) return wrong_mask(*step.y);
  // A masked read goes through a scratch plane; with every cell off the host is still asked, so that a wrong
  // name is reported whatever the data.
  const bool direct = open == Gate::kOpen && mask == nullptr;
  const Plane to = direct ? *step.y : step.scratch;
  const HostStatus status = read(step, to);
  if (status != HostStatus::kOk) return outcome(status);
  if (mask != nullptr) copy(*step.y, to, mask);
  return Status::kBudget;
}

HostStatus Vm::read(const Step& step, Plane to) {
  switch (step.op) {
    case Opcode::kArrayOpen:
      return host_.open_array(step.text, to);
    case Opcode::kImageOpen:
      return host_.open_image(step.text, to);
    case Opcode::kImageOpenCount:
      return host_.open_image(numbered(step.text, *step.scalars[1]), to);
    case Opcode::kClipRead:
      return host_.read_clip(to);
    case Opcode::kWebcamRead:
      return host_.read_camera(to);
    default:
      return host_.sense(step.text, to);
  }
}

Status Vm::save_numbered(const Step& step) {
  return outcome(host_.save_image(numbered(step.text, *step.scalars[2]), *step.planes[0]));
}

std::string_view Vm::register_name(const Step& step) const {
  return program_.registers[program_.code[static_cast<std::size_t>(&step - steps_.data())].operands[0].index]
      .name;
}

Status Vm::plugin_with(const Step& step) {
  if (plugin_arguments_.size() == program::kMaxPluginArguments)
    return fail(Status::kFailed,
                "a plugin takes at most " + std::to_string(program::kMaxPluginArguments) + " arguments");
  plugin_arguments_.push_back({step.planes[0] != nullptr ? ConstPlane(*step.planes[0]) : ConstPlane(),
                               step.scalars[0] != nullptr ? *step.scalars[0] : 0.0F});
  return Status::kBudget;
}

Status Vm::plugin(const Step& step) {
  const std::string& module = program_.modules[step.table];
  const float number = *step.scalars[1];
  if (!(number >= 0.0F && number < 1e9F && number == std::floor(number)))
    return fail(Status::kFailed, "a plugin's operation is a whole number from 0, not " + number_text(number));
  const float* mask = nullptr;
  const Gate open = step.y != nullptr ? gate(step, mask) : Gate::kOpen;
  if (open == Gate::kMismatch) return wrong_mask(*step.y);
  // Always by way of a plane of its own: the destination may be an argument.
  Plane to{};
  if (step.y != nullptr) {
    to = step.scratch;
    copy(to, *step.y, nullptr);
  }
  const HostStatus status =
      host_.call_plugin(module, static_cast<int>(number), plugin_arguments_, to, step.variable);
  plugin_arguments_.clear();
  if (status != HostStatus::kOk) return outcome(status);
  if (step.y != nullptr && open == Gate::kOpen) copy(*step.y, to, mask);
  return Status::kBudget;
}

void Vm::print_value(const Step& step) {
  NumberBuffer buffer;
  if (step.scalars[0] != nullptr) return host_.print(number_text(*step.scalars[0], buffer));
  const ConstPlane plane = *step.planes[0];
  for (std::uint32_t y = 0; y < plane.height; ++y) {
    if (y > 0) host_.print("\n");
    for (std::uint32_t x = 0; x < plane.width; ++x) {
      if (x > 0) host_.print(" ");
      host_.print(number_text(plane.row(y)[x], buffer));
    }
  }
}

Status Vm::surface_value(const Step& step, std::optional<double> value) {
  if (!value) return fail(Status::kRefused, host_.message());
  *step.variable = static_cast<float>(*value);
  return Status::kBudget;
}

Status Vm::outcome(HostStatus status) {
  switch (status) {
    case HostStatus::kOk:
      return Status::kBudget;
    case HostStatus::kClosed:
      return Status::kClosed;
    case HostStatus::kPeerLost:
      return Status::kPeerLost;
    case HostStatus::kInterrupted:
      return Status::kInterrupted;
    case HostStatus::kRefused:
      return fail(Status::kRefused, host_.message());
    case HostStatus::kFailed:
      return fail(Status::kFailed, host_.message());
  }
  return Status::kFailed;
}

}  // namespace apron::vm
