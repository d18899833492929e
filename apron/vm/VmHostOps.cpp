// Instructions that call the host.
#include <cassert>
#include <cmath>
#include <string>

#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/NumberFormat.h"
#include "apron/vm/Vm.h"

namespace apron::vm {

using program::Opcode;

namespace {

constexpr double kMaxTileColumns = 64.0;

// File name of image n of a sequence. n replaces the run of '#', zero-padded to its length; without a '#' it
// is inserted before the extension.
std::string numbered_file_name(std::string_view name, double n) {
  std::string digits(format_number(n));
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

Status Vm::execute_host_op(const DecodedInstruction& decoded) {
  switch (decoded.op) {
    case Opcode::kPrintText:
      host_.print(decoded.text);
      return Status::kRunning;
    case Opcode::kPrintLine:
      host_.print("\n");
      return Status::kRunning;
    case Opcode::kPrintValue:
      print_value(decoded);
      return Status::kRunning;
    case Opcode::kParameter:
      *decoded.destination_variable = host_.parameter(decoded.text).value_or(decoded.default_value);
      return Status::kRunning;
    case Opcode::kKeyPressed:
      *decoded.destination_variable = host_.take_key();
      return Status::kRunning;
    case Opcode::kKeyDown: {
      const double code = *decoded.scalars[0];
      const bool valid = code >= 1.0 && code < 1024.0;
      *decoded.destination_variable = valid && host_.key_down(static_cast<int>(code)) ? 1.0 : 0.0;
      return Status::kRunning;
    }
    case Opcode::kArrayOpen:
    case Opcode::kImageOpen:
    case Opcode::kImageOpenCount:
    case Opcode::kClipRead:
    case Opcode::kWebcamRead:
    case Opcode::kSurfaceSense:
      return execute_host_read(decoded);
    case Opcode::kImageSaveCount:
      return save_numbered_image(decoded);
    case Opcode::kClipOpen:
      return to_status(host_.open_clip(decoded.text));
    case Opcode::kClipClose:
      host_.close_clip();
      return Status::kRunning;
    case Opcode::kWebcamOpen: {
      const double number = *decoded.scalars[0];
      return to_status(host_.open_camera(number >= 0.0 && number < 1e6 ? static_cast<int>(number) : -1));
    }
    case Opcode::kWebcamClose:
      host_.close_camera();
      return Status::kRunning;
    case Opcode::kShow:
      host_.show(register_name(decoded), decoded.text);
      return Status::kRunning;
    case Opcode::kDisplay:
      host_.display(register_name(decoded), decoded.text);
      return Status::kRunning;
    case Opcode::kTile: {
      const double columns = *decoded.scalars[0];
      host_.tile(columns >= 1.0 ? static_cast<int>(std::fmin(columns, kMaxTileColumns)) : 0);
      return Status::kRunning;
    }
    case Opcode::kTimerStart:
      host_.start_timer(decoded.text);
      return Status::kRunning;
    case Opcode::kTimerStop:
      host_.stop_timer(decoded.text);
      return Status::kRunning;
    case Opcode::kTimerReset:
      host_.reset_timer(decoded.text);
      return Status::kRunning;
    case Opcode::kTimerRead:
      *decoded.destination_variable = static_cast<float>(host_.read_timer_s(decoded.text));
      return Status::kRunning;
    case Opcode::kTimerWait:
      return to_status(host_.wait(*decoded.scalars[0]));
    case Opcode::kLabel: {
      NumberBuffer buffer;
      host_.label(decoded.text, format_number(*decoded.scalars[1], buffer));
      return Status::kRunning;
    }
    case Opcode::kLabelText: {
      const program::Instruction& label = program_.code[static_cast<std::size_t>(&decoded - decoded_.data())];
      host_.label(program_.texts[label.operands[0].index], program_.texts[label.operands[1].index]);
      return Status::kRunning;
    }
    case Opcode::kSetPalette:
      host_.set_palette(register_name(decoded), decoded.text);
      return Status::kRunning;
    case Opcode::kSetScale:
      host_.set_scale(register_name(decoded), static_cast<float>(*decoded.scalars[1]),
                      static_cast<float>(*decoded.scalars[2]));
      return Status::kRunning;
    case Opcode::kPluginWith:
      return push_plugin_argument(decoded);
    case Opcode::kPlugin:
    case Opcode::kPluginDo:
      return execute_plugin(decoded);
    case Opcode::kArraySave:
      return to_status(host_.save_array(decoded.text, *decoded.planes[0]));
    case Opcode::kImageSave:
      return to_status(host_.save_image(decoded.text, *decoded.planes[0]));
    case Opcode::kSurfaceActuate:
      return to_status(decoded.scalars[1] != nullptr
                           ? host_.actuate(decoded.text, static_cast<float>(*decoded.scalars[1]))
                           : host_.actuate(decoded.text, *decoded.planes[1]));
    case Opcode::kSurfaceStep: {
      const HostStatus status = host_.step();
      return status == HostStatus::kOk ? Status::kTick : to_status(status);
    }
    case Opcode::kSurfaceFreeRun:
      host_.set_free_run(*decoded.scalars[0] != 0.0);
      return Status::kRunning;
    case Opcode::kSurfaceTime:
      return set_surface_value(decoded, host_.time_s());
    case Opcode::kSurfaceDt:
      return set_surface_value(decoded, host_.dt_s());
    case Opcode::kSurfaceTick:
      return set_surface_value(decoded, host_.tick());
    case Opcode::kSurfaceHas:
      *decoded.destination_variable = host_.has(decoded.text) ? 1.0F : 0.0F;
      return Status::kRunning;
    default:
      assert(false && "an opcode without an action");
      return Status::kFailed;
  }
}

Status Vm::execute_host_read(const DecodedInstruction& decoded) {
  const float* mask = nullptr;
  const WriteAccess access = check_write_access(decoded, mask);
  if (access == WriteAccess::kShapeMismatch) return report_mask_mismatch(*decoded.destination);
  // A masked read goes through a scratch plane. The host is called even if no cell is active, so that a wrong
  // name is reported independently of the data.
  const bool direct = access == WriteAccess::kAllowed && mask == nullptr;
  const Plane to = direct ? *decoded.destination : decoded.scratch;
  const HostStatus status = read_from_host(decoded, to);
  if (status != HostStatus::kOk) return to_status(status);
  if (mask != nullptr) copy_plane(*decoded.destination, to, mask);
  return Status::kRunning;
}

HostStatus Vm::read_from_host(const DecodedInstruction& decoded, Plane to) {
  switch (decoded.op) {
    case Opcode::kArrayOpen:
      return host_.open_array(decoded.text, to);
    case Opcode::kImageOpen:
      return host_.open_image(decoded.text, to);
    case Opcode::kImageOpenCount:
      return host_.open_image(numbered_file_name(decoded.text, *decoded.scalars[1]), to);
    case Opcode::kClipRead:
      return host_.read_clip(to);
    case Opcode::kWebcamRead:
      return host_.read_camera(to);
    default:
      return host_.sense(decoded.text, to);
  }
}

Status Vm::save_numbered_image(const DecodedInstruction& decoded) {
  return to_status(
      host_.save_image(numbered_file_name(decoded.text, *decoded.scalars[2]), *decoded.planes[0]));
}

std::string_view Vm::register_name(const DecodedInstruction& decoded) const {
  return program_
      .registers[program_.code[static_cast<std::size_t>(&decoded - decoded_.data())].operands[0].index]
      .name;
}

Status Vm::push_plugin_argument(const DecodedInstruction& decoded) {
  if (plugin_arguments_.size() == program::kMaxPluginArguments)
    return fail(Status::kFailed,
                "a plugin takes at most " + std::to_string(program::kMaxPluginArguments) + " arguments");
  plugin_arguments_.push_back(
      {decoded.planes[0] != nullptr ? ConstPlane(*decoded.planes[0]) : ConstPlane(),
       decoded.scalars[0] != nullptr ? static_cast<float>(*decoded.scalars[0]) : 0.0F});
  return Status::kRunning;
}

Status Vm::execute_plugin(const DecodedInstruction& decoded) {
  const std::string& module = program_.modules[decoded.table_index];
  const double number = *decoded.scalars[1];
  if (!(number >= 0.0 && number < 1e9 && number == std::floor(number)))
    return fail(Status::kFailed,
                "a plugin's operation is a whole number from 0, not " + format_number(number));
  const float* mask = nullptr;
  const WriteAccess access =
      decoded.destination != nullptr ? check_write_access(decoded, mask) : WriteAccess::kAllowed;
  if (access == WriteAccess::kShapeMismatch) return report_mask_mismatch(*decoded.destination);
  // The plugin writes to a scratch plane, because the destination may also be an argument.
  Plane to{};
  if (decoded.destination != nullptr) {
    to = decoded.scratch;
    copy_plane(to, *decoded.destination, nullptr);
  }
  float value =
      decoded.destination_variable != nullptr ? static_cast<float>(*decoded.destination_variable) : 0.0F;
  const HostStatus status = host_.call_plugin(module, static_cast<int>(number), plugin_arguments_, to,
                                              decoded.destination_variable != nullptr ? &value : nullptr);
  if (decoded.destination_variable != nullptr) *decoded.destination_variable = value;
  plugin_arguments_.clear();
  if (status != HostStatus::kOk) return to_status(status);
  if (decoded.destination != nullptr && access == WriteAccess::kAllowed)
    copy_plane(*decoded.destination, to, mask);
  return Status::kRunning;
}

void Vm::print_value(const DecodedInstruction& decoded) {
  NumberBuffer buffer;
  if (decoded.scalars[0] != nullptr) return host_.print(format_number(*decoded.scalars[0], buffer));
  const ConstPlane plane = *decoded.planes[0];
  for (std::uint32_t y = 0; y < plane.height; ++y) {
    if (y > 0) host_.print("\n");
    for (std::uint32_t x = 0; x < plane.width; ++x) {
      if (x > 0) host_.print(" ");
      host_.print(format_number(plane.row(y)[x], buffer));
    }
  }
}

Status Vm::set_surface_value(const DecodedInstruction& decoded, std::optional<double> value) {
  if (!value) return fail(Status::kRefused, host_.message());
  *decoded.destination_variable = program::to_scalar(*value);
  return Status::kRunning;
}

Status Vm::to_status(HostStatus status) {
  switch (status) {
    case HostStatus::kOk:
      return Status::kRunning;
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
