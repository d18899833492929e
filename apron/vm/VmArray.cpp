// The VM's instructions on neighbourhoods, random numbers, the stack and elements by number.
#include <bit>
#include <cassert>
#include <cmath>
#include <new>

#include "apron/vm/Neighbourhood.h"
#include "apron/vm/NumberText.h"
#include "apron/vm/Propagation.h"
#include "apron/vm/Vm.h"

namespace apron::vm {

using program::Opcode;

Status Vm::array_step(const Step& step) {
  switch (step.op) {
    case Opcode::kFilterSet:
      return set_filter(step);
    case Opcode::kRandomFloat:
    case Opcode::kRandomGauss:
    case Opcode::kRandomInt:
      return random(step);
    case Opcode::kRandomSeed:
      draw_ = {std::bit_cast<std::uint32_t>(*step.scalars[0]), 0};
      return Status::kBudget;
    case Opcode::kStackPush:
      return push(step);
    case Opcode::kStackPop:
      return pop(step);
    case Opcode::kStackClear:
      free_stack_.insert(free_stack_.end(), stack_.begin(), stack_.end());
      stack_.clear();
      return Status::kBudget;
    case Opcode::kResGetVar:
    case Opcode::kResSetVar:
    case Opcode::kResGetReg:
    case Opcode::kResSetReg:
      return element(step);
    default:
      return neighbourhood(step);
  }
}

Status Vm::neighbourhood(const Step& step) {
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(*step.y);
  const ConstPlane a = *step.planes[0];
  const Plane to = mask == nullptr ? *step.y : step.scratch;
  switch (step.op) {
    case Opcode::kFilterDo: {
      const program::Filter& with = program_.filters[step.table];
      filter(executor_, {with.width, with.height, with.elements.data()}, *step.y, a, edge_, mask);
      return Status::kBudget;
    }
    case Opcode::kFlood:
      objects_.flood(to, a, *step.planes[1]);
      break;
    case Opcode::kDistance:
      distance(to, a);
      break;
    case Opcode::kSpreadMax:
      objects_.spread_max(to, a, *step.planes[1], executor_.kernels());
      break;
    default:
      near(executor_, step.op, *step.scalars[1] == 8.0F, *step.y, a, edge_, mask);
      return Status::kBudget;
  }
  if (mask != nullptr) copy(*step.y, to, mask);
  return Status::kBudget;
}

// All cells, or those where the mask is non-zero. One shape.
void Vm::copy(Plane y, ConstPlane a, const float* mask) noexcept {
  Block block;
  block.y = y.data;
  block.source[0] = a.data;
  block.mask = mask;
  block.set_pitch(y.pitch);
  block.rows = y.height;
  block.columns = y.width;
  executor_.run(executor_.kernels().kernel(Opcode::kCopy, 0, mask != nullptr), block);
}

Status Vm::set_filter(const Step& step) {
  program::Filter& filter = program_.filters[step.table];
  const float index = *step.scalars[1];
  if (!(index >= 0.0F && index < static_cast<float>(filter.elements.size())))
    return fail(Status::kFailed, "the filter '" + filter.name + "' of " + std::to_string(filter.width) + "x" +
                                     std::to_string(filter.height) + " has no element number " +
                                     number_text(index));
  filter.elements[static_cast<std::size_t>(index)] = *step.scalars[2];
  return Status::kBudget;
}

Status Vm::random(const Step& step) {
  const Draw draw = draw_;
  ++draw_.number;  // whatever the mask
  const float a = *step.scalars[0], b = *step.scalars[1];
  if (step.variable != nullptr) {
    *step.variable = draw(step.op, 0, 0, a, b);
    return Status::kBudget;
  }
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(*step.y);
  executor_.rows(step.y->height, step.y->width, [&](std::uint32_t first, std::uint32_t last) {
    for (std::uint32_t row = first; row < last; ++row) {
      float* to = step.y->row(row);
      const float* on = mask != nullptr ? mask + (to - step.y->data) : nullptr;
      for (std::uint32_t x = 0; x < step.y->width; ++x)
        if (on == nullptr || on[x] != 0.0F) to[x] = draw(step.op, x, row, a, b);
    }
  });
  return Status::kBudget;
}

Status Vm::push(const Step& step) {
  const ConstPlane a = *step.planes[0];
  if (stack_.size() == program::kMaxStackDepth)
    return fail(Status::kFailed,
                "more than " + std::to_string(program::kMaxStackDepth) + " registers are on the stack");
  auto place = free_stack_.begin();
  while (place != free_stack_.end() && !same_shape(*place, a)) ++place;
  if (place == free_stack_.end()) {
    stack_bytes_ += a.cells() * sizeof(float);
    if (stack_bytes_ > program::kMaxMemory)
      return fail(Status::kFailed,
                  "the stack takes more than " + std::to_string(program::kMaxMemory) + " bytes");
    try {
      place = free_stack_.insert(free_stack_.end(), store_.add(a.width, a.height));
    } catch (const std::bad_alloc&) {
      return fail(Status::kFailed, "there is not enough memory for the stack");
    }
  }
  copy(*place, a, nullptr);
  stack_.push_back(*place);
  free_stack_.erase(place);
  return Status::kBudget;
}

Status Vm::pop(const Step& step) {
  if (stack_.empty()) return fail(Status::kFailed, "stack.pop_reg finds the stack empty");
  const Plane top = stack_.back();
  if (!same_shape(top, *step.y))
    return fail(Status::kFailed, "stack.pop_reg finds a register of " + shape_text(top) +
                                     ", and the destination is " + shape_text(*step.y));
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open == Gate::kMismatch) return wrong_mask(*step.y);
  if (open == Gate::kOpen) copy(*step.y, top, mask);
  stack_.pop_back();
  free_stack_.push_back(top);
  return Status::kBudget;
}

Status Vm::element(const Step& step) {
  const program::Group& group = program_.groups[step.table];
  const float number = *step.scalars[1];
  if (!(number >= 0.0F && number < static_cast<float>(group.elements.size()) && number == std::floor(number)))
    return fail(Status::kFailed, "the class " + group.name + " has " + std::to_string(group.elements.size()) +
                                     (group.elements.size() == 1 ? " element" : " elements") +
                                     ", numbered from 0; there is no number " + number_text(number));
  const std::uint32_t index = group.elements[static_cast<std::size_t>(number)];
  if (step.op == Opcode::kResGetVar) {
    *step.variable = storage_.scalars[index];
    return Status::kBudget;
  }
  if (step.op == Opcode::kResSetVar) {
    storage_.scalars[index] = *step.scalars[2];
    return Status::kBudget;
  }
  return element_register(step, storage_.registers[index]);
}

Status Vm::element_register(const Step& step, Plane reg) {
  const bool get = step.op == Opcode::kResGetReg;
  const Plane y = get ? *step.y : reg;
  const ConstPlane a = get                         ? ConstPlane(reg)
                       : step.planes[2] != nullptr ? ConstPlane(*step.planes[2])
                                                   : ConstPlane();
  if (a.data != nullptr && !same_shape(y, a))
    return fail(Status::kFailed,
                "a register of " + shape_text(a) + " does not go into one of " + shape_text(y));
  const float* mask = nullptr;
  Step write = step;
  write.y = &y;
  const Gate open = gate(write, mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(y);
  if (a.data != nullptr) {
    if (a.data != y.data) copy(y, a, mask);
    return Status::kBudget;
  }
  Block block;
  block.y = y.data;
  block.scalar[0] = *step.scalars[2];
  block.mask = mask;
  block.set_pitch(y.pitch);
  block.rows = y.height;
  block.columns = y.width;
  executor_.run(executor_.kernels().kernel(Opcode::kCopy, 1, mask != nullptr), block);
  return Status::kBudget;
}

}  // namespace apron::vm
