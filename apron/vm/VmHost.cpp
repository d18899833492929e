// The VM's instructions that call the host.
#include <cassert>

#include "apron/vm/NumberText.h"
#include "apron/vm/Vm.h"

namespace apron::vm {

using program::Opcode;

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
    case Opcode::kSurfaceSense:
      return read_plane(step);
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
  const HostStatus status = step.op == Opcode::kArrayOpen   ? host_.open_array(step.text, to)
                            : step.op == Opcode::kImageOpen ? host_.open_image(step.text, to)
                                                            : host_.sense(step.text, to);
  if (status != HostStatus::kOk) return outcome(status);
  if (mask != nullptr) {
    Block block;
    block.y = step.y->data;
    block.source[0] = to.data;
    block.mask = mask;
    block.set_pitch(to.pitch);
    block.rows = to.height;
    block.columns = to.width;
    executor_.run(executor_.kernels().kernel(Opcode::kCopy, 0, true), block);
  }
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
