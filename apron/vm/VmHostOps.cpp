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
constexpr double kCameras = 1e6;

bool is_image_number(double n) { return n >= 0.0 && program::is_whole_scalar(n); }

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
  const char destination = program::opcode_info(decoded.op).signature.front();
  if (destination == 'V') return read_host_scalar(decoded);
  if (destination == 'R') return execute_host_read(decoded);
  switch (decoded.op) {
    case Opcode::kImageSaveCount:
      if (!is_image_number(*decoded.scalars[2])) return fail_image_number(*decoded.scalars[2]);
      return to_status(host_.save_image(numbered_file_name(decoded.text, *decoded.scalars[2]),
                                        floats_for_host(decoded, 0)));
    case Opcode::kClipOpen:
      return to_status(host_.open_clip(decoded.text));
    case Opcode::kWebcamOpen: {
      const double number = *decoded.scalars[0];
      if (!(number >= 0.0 && number < kCameras))
        return fail(Status::kRefused, "a camera's number must be 0 to " + format_number(kCameras - 1.0) +
                                          ", not " + format_number(number));
      return to_status(host_.open_camera(static_cast<int>(number)));
    }
    case Opcode::kTimerWait:
      return to_status(host_.wait(*decoded.scalars[0]));
    case Opcode::kPluginWith:
      return push_plugin_argument(decoded);
    case Opcode::kPlugin:
    case Opcode::kPluginDo:
      return execute_plugin(decoded);
    case Opcode::kArraySave:
      return to_status(host_.save_array(decoded.text, *decoded.planes[0]));
    case Opcode::kImageSave:
      return to_status(host_.save_image(decoded.text, floats_for_host(decoded, 0)));
    case Opcode::kSurfaceActuate:
      return to_status(decoded.scalars[1] != nullptr
                           ? host_.actuate(decoded.text, static_cast<float>(*decoded.scalars[1]))
                           : host_.actuate(decoded.text, floats_for_host(decoded, 1)));
    case Opcode::kSurfaceStep: {
      const HostStatus status = host_.step();
      return status == HostStatus::kOk ? Status::kTick : to_status(status);
    }
    default:
      notify_host(decoded);
      return Status::kRunning;
  }
}

Status Vm::fail_image_number(double number) {
  return fail(Status::kFailed,
              "the number of an image is a whole number from 0 to 2^53, not " + format_number(number));
}

// The operand's cells as floats, which are all that images and surfaces know.
ConstPlane Vm::floats_for_host(const DecodedInstruction& decoded, std::size_t operand) {
  if (!program::is_integer(decoded.type)) return *decoded.planes[operand];
  convert_plane(executor_, decoded.scratch, *decoded.planes[operand]);
  return decoded.scratch;
}

// The instructions that cannot fail.
void Vm::notify_host(const DecodedInstruction& decoded) {
  switch (decoded.op) {
    case Opcode::kPrintText:
      return host_.print(decoded.text);
    case Opcode::kPrintLine:
      return host_.print("\n");
    case Opcode::kPrintValue:
      return print_value(decoded);
    case Opcode::kClipClose:
      return host_.close_clip();
    case Opcode::kWebcamClose:
      return host_.close_camera();
    case Opcode::kShow:
      return host_.show(register_name(decoded), decoded.text);
    case Opcode::kDisplay:
      return host_.display(register_name(decoded), decoded.text);
    case Opcode::kTile: {
      const double columns = *decoded.scalars[0];
      return host_.tile(columns >= 1.0 ? static_cast<int>(std::fmin(columns, kMaxTileColumns)) : 0);
    }
    case Opcode::kTimerStart:
      return host_.start_timer(decoded.text);
    case Opcode::kTimerStop:
      return host_.stop_timer(decoded.text);
    case Opcode::kTimerReset:
      return host_.reset_timer(decoded.text);
    case Opcode::kLabel: {
      NumberBuffer buffer;
      return host_.label(decoded.text, format_number(*decoded.scalars[1], buffer));
    }
    case Opcode::kLabelText: {
      const program::Instruction& label = program_.code[&decoded - decoded_.data()];
      return host_.label(program_.texts[label.operands[0].index], program_.texts[label.operands[1].index]);
    }
    case Opcode::kSetPalette:
      return host_.set_palette(register_name(decoded), decoded.text);
    case Opcode::kSetScale:
      return host_.set_scale(register_name(decoded), static_cast<float>(*decoded.scalars[1]),
                             static_cast<float>(*decoded.scalars[2]));
    case Opcode::kSurfaceFreeRun:
      return host_.set_free_run(*decoded.scalars[0] != 0.0);
    default:
      assert(false && "an opcode without an action");
  }
}

Status Vm::read_host_scalar(const DecodedInstruction& decoded) {
  const std::optional<double> value = host_scalar(decoded);
  if (!value) return fail(Status::kRefused, host_.message());
  *decoded.destination_variable = program::to_scalar(*value);
  return Status::kRunning;
}

// Empty if the host refuses.
std::optional<double> Vm::host_scalar(const DecodedInstruction& decoded) {
  switch (decoded.op) {
    case Opcode::kParameter:
      return host_.parameter(decoded.text).value_or(decoded.default_value);
    case Opcode::kKeyPressed:
      return host_.take_key();
    case Opcode::kKeyDown: {
      const double code = *decoded.scalars[0];
      return code >= 1.0 && code < 1024.0 && host_.key_down(static_cast<int>(code)) ? 1.0 : 0.0;
    }
    case Opcode::kTimerRead:
      return static_cast<float>(host_.read_timer_s(decoded.text));
    case Opcode::kSurfaceHas:
      return host_.has(decoded.text) ? 1.0 : 0.0;
    case Opcode::kSurfaceTime:
      return host_.time_s();
    case Opcode::kSurfaceDt:
      return host_.dt_s();
    default:
      return host_.tick();
  }
}

Status Vm::execute_host_read(const DecodedInstruction& decoded) {
  if (decoded.op == Opcode::kImageOpenCount && !is_image_number(*decoded.scalars[1]))
    return fail_image_number(*decoded.scalars[1]);
  const float* mask = nullptr;
  const WriteAccess access = check_write_access(decoded, *decoded.destination, mask);
  if (access == WriteAccess::kShapeMismatch) return report_mask_mismatch(*decoded.destination);
  // A masked read goes through a scratch plane. The host is called even if no cell is active, so that a wrong
  // name is reported independently of the data.
  const bool is_converted = program::is_integer(decoded.type) && decoded.op != Opcode::kArrayOpen;
  const bool direct = access == WriteAccess::kAllowed && mask == nullptr && !is_converted;
  const Plane to = direct ? *decoded.destination : decoded.scratch;
  const HostStatus status = read_from_host(decoded, to);
  if (status != HostStatus::kOk) return to_status(status);
  if (access == WriteAccess::kAllowed && !direct)
    convert_plane(executor_, *decoded.destination, to, false, mask);
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

std::string_view Vm::register_name(const DecodedInstruction& decoded) const {
  return program_.registers[program_.code[&decoded - decoded_.data()].operands[0].index].name;
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
  const std::string& module = program_.modules[decoded.table_index].name;
  const double number = *decoded.scalars[1];
  if (!(number >= 0.0 && number < 1e9 && number == std::floor(number)))
    return fail(Status::kFailed,
                "a plugin's operation is a whole number from 0, not " + format_number(number));
  const float* mask = nullptr;
  const WriteAccess access = decoded.destination != nullptr
                                 ? check_write_access(decoded, *decoded.destination, mask)
                                 : WriteAccess::kAllowed;
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
      host_.print(program::is_integer(plane.type) ? format_number(cell_value(plane, x, y), buffer)
                                                  : format_number(plane.row(y)[x], buffer));
    }
  }
}

Status Vm::to_status(HostStatus status) {
  static constexpr Status kStatus[] = {Status::kRunning,     Status::kClosed,  Status::kPeerLost,
                                       Status::kInterrupted, Status::kRefused, Status::kFailed};
  const Status result = kStatus[static_cast<std::size_t>(status)];  // in the order of HostStatus
  return status < HostStatus::kRefused ? result : fail(result, host_.message());
}

}  // namespace apron::vm
