#include "apron/vm/Vm.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <map>

#include "apron/vm/NumberText.h"
#include "apron/vm/ScalarKernels.h"
#include "apron/vm/Shift.h"

namespace apron::vm {

using program::Opcode;

Vm::Vm(program::Program program, VmOptions options, Host& host)
    : program_(std::move(program)),
      stop_(options.stop),
      host_(host),
      executor_(options.kernels != nullptr ? *options.kernels : kernel_table(), std::max(options.threads, 1U),
                options.parallel_cells),
      masks_(executor_) {
  std::uint32_t rows = 0;
  for (const program::Register& r : program_.registers) {
    storage_.registers.push_back(store_.add(r.width, r.height));
    rows = std::max(rows, r.height);
  }
  row_results_.resize(rows);
  for (const program::Variable& v : program_.variables) storage_.scalars.push_back(v.initial);
  storage_.scalars.insert(storage_.scalars.end(), program_.literals.begin(), program_.literals.end());
  steps_.reserve(program_.code.size());
  for (const program::Instruction& i : program_.code) {
    Step& step = steps_.emplace_back(decode(program_, i, storage_, executor_.kernels()));
    const bool goes_by_scratch = step.action == Action::kHost || step.action == Action::kArray;
    if (goes_by_scratch && step.y != nullptr && (step.masked || step.op == Opcode::kPlugin)) {
      step.scratch = scratch(*step.y);
    }
    if (step.op == Opcode::kFlood || step.op == Opcode::kSpreadMax)
      objects_.reserve(step.y->width, step.y->height);
  }
  calls_.reserve(program::kMaxCallDepth);
  plugin_arguments_.reserve(program::kMaxPluginArguments);
  reserve_masks();
  if (options.profile) {
    options.fuse.on = false;
    set_profiling(true);
  }
  segments_ = std::make_unique<Segments>(program_, steps_, storage_, executor_, options.fuse,
                                         std::max(options.threads, 1U), options.parallel_cells);
}

Plane Vm::scratch(const Plane& like) {
  for (const Plane& plane : scratch_)
    if (same_shape(plane, like)) return plane;
  return scratch_.emplace_back(store_.add(like.width, like.height));
}

// As many planes of each shape as the program can have masks in force, short of recursion.
void Vm::reserve_masks() {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> planes;
  for (const Step& step : steps_) {
    const Plane* condition = step.planes[0];
    if (step.action != Action::kMask || condition == nullptr) continue;
    std::size_t& count = planes[{condition->width, condition->height}];
    if (count == 0) count = 2;  // the base, and the base with a condition
    if (step.op == Opcode::kMaskPush) count = std::min(count + 1, program::kMaxMaskDepth + 2);
  }
  for (const auto& [shape, count] : planes) masks_.reserve(shape.first, shape.second, count);
}

void Vm::set_profiling(bool on) {
  profiling_ = on;
  if (on) spent_.resize(program_.code.size());
}

Status Vm::run(std::uint64_t budget) {
  if (final_ != Status::kBudget) return final_;
  for (; budget > 0; --budget) {
    if (stop_ != nullptr && stop_->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (Segment* fused = profiling_ ? nullptr : segment(budget)) {
      fused->run(masks_.mask());
      next_ = fused->exit();
      executed_ += fused->steps();
      budget -= fused->steps() - 1;
      continue;
    }
    const std::size_t at = next_;
    const Status status = profiling_ ? measure(next_++) : execute(steps_[next_++]);
    ++executed_;
    if (status == Status::kBudget) continue;
    if (status == Status::kTick) return status;
    next_ = at;
    if (status != Status::kInterrupted) final_ = status;
    return status;
  }
  return Status::kBudget;
}

Status Vm::measure(std::size_t at) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  const Status status = execute(steps_[at]);
  const auto took = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start);
  ++spent_[at].count;
  spent_[at].nanoseconds += static_cast<std::uint64_t>(took.count());
  return status;
}

// The segment that begins here, unless it would go beyond the budget or come to a limit that its steps check.
Segment* Vm::segment(std::uint64_t budget) const noexcept {
  Segment* fused = segments_->at(static_cast<std::uint32_t>(next_), masks_);
  if (fused == nullptr || fused->steps() > budget) return nullptr;
  const bool room = masks_.depth() + fused->masks() <= program::kMaxMaskDepth &&
                    calls_.size() + fused->calls() <= program::kMaxCallDepth;
  return room ? fused : nullptr;
}

Status Vm::execute(const Step& step) {
  switch (step.action) {
    case Action::kElementwise:
      return elementwise(step);
    case Action::kScalar: {
      const auto value = [&](std::size_t k) { return step.scalars[k] != nullptr ? *step.scalars[k] : 0.0F; };
      *step.variable = evaluate(step.op, value(0), value(1), value(2));
      return Status::kBudget;
    }
    case Action::kShift:
      return shift_image(step);
    case Action::kMask:
      return change_mask(step);
    case Action::kReduce:
      return reduce(step);
    case Action::kCell:
      return step.op == Opcode::kCellX || step.op == Opcode::kCellY ? coordinates(step) : pixel(step);
    case Action::kArray:
      return array_step(step);
    case Action::kFlow:
      return flow(step);
    case Action::kHost:
      return host_call(step);
  }
  return Status::kFailed;
}

Vm::Gate Vm::gate(const Step& step, const float*& mask) const noexcept {
  mask = nullptr;
  if (!step.masked || masks_.active() == MaskStack::Active::kAll) return Gate::kOpen;
  if (masks_.active() == MaskStack::Active::kNone) return Gate::kShut;
  if (!same_shape(masks_.mask(), *step.y)) return Gate::kMismatch;
  mask = masks_.mask().data;
  return Gate::kOpen;
}

Status Vm::elementwise(const Step& step) {
  Block block;
  const Gate open = gate(step, block.mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(*step.y);
  block.y = step.y->data;
  block.set_pitch(step.y->pitch);
  block.rows = step.y->height;
  block.columns = step.y->width;
  for (std::size_t k = 0; k < program::kMaxSources; ++k) {
    if (step.planes[k] != nullptr) block.source[k] = step.planes[k]->data;
    if (step.scalars[k] != nullptr) block.scalar[k] = *step.scalars[k];
  }
  executor_.run(step.kernels[block.mask != nullptr ? 1 : 0], block);
  return Status::kBudget;
}

Status Vm::shift_image(const Step& step) {
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(*step.y);
  const Edge wrap{program::BoundaryRule::kWrap, 0.0F};
  shift(executor_, *step.y, *step.planes[0], step.offset, step.op == Opcode::kRotate ? wrap : edge_, mask);
  return Status::kBudget;
}

Status Vm::reduce(const Step& step) {
  const ConstPlane a = *step.planes[0];
  const Reduction kind = step.op == Opcode::kGlobalSum || step.op == Opcode::kGlobalMean ? Reduction::kSum
                         : step.op == Opcode::kGlobalMin                                 ? Reduction::kMin
                         : step.op == Opcode::kGlobalMax                                 ? Reduction::kMax
                                                                                         : Reduction::kCount;
  const RowReduction row_reduction = executor_.kernels().reduction(kind);
  executor_.rows(a.height, a.width, [&](std::uint32_t first, std::uint32_t last) {
    row_reduction(a.row(first), a.pitch, last - first, a.width, &row_results_[first]);
  });
  const auto begin = row_results_.begin(), end = begin + a.height;
  double result = *begin;
  for (auto row = begin + 1; row != end; ++row) {
    if (kind == Reduction::kMin)
      result = *row < result ? *row : result;
    else if (kind == Reduction::kMax)
      result = *row > result ? *row : result;
    else
      result += *row;
  }
  auto value = static_cast<float>(result);
  if (step.op == Opcode::kGlobalMean) value /= static_cast<float>(a.cells());
  if (step.op == Opcode::kGlobalAny) value = value != 0.0F ? 1.0F : 0.0F;
  *step.variable = value;
  return Status::kBudget;
}

Status Vm::change_mask(const Step& step) {
  const ConstPlane plane = step.planes[0] != nullptr ? ConstPlane(*step.planes[0]) : ConstPlane();
  switch (step.op) {
    case Opcode::kMaskOn:
      if (!masks_.set_base(plane))
        return fail(Status::kFailed, "mask.on takes a register of " + shape_text(plane) +
                                         " inside a where of " + "another size");
      break;
    case Opcode::kMaskOff:
      masks_.clear_base();
      break;
    case Opcode::kMaskPush:
      if (masks_.depth() == program::kMaxMaskDepth)
        return fail(Status::kFailed,
                    "where is nested more than " + std::to_string(program::kMaxMaskDepth) + " deep");
      if (plane.data == nullptr)
        masks_.push(*step.scalars[0]);
      else if (!masks_.push(plane))
        return fail(Status::kFailed, "where takes a register of " + shape_text(plane) +
                                         ", but the mask in force is " + shape_text(masks_.mask()));
      break;
    case Opcode::kMaskElse:
      masks_.invert_top();
      break;
    default:
      masks_.pop();
      break;
  }
  return Status::kBudget;
}

Status Vm::pixel(const Step& step) {
  const bool get = step.op == Opcode::kPixelGet;
  const float x = *step.scalars[get ? 1 : 0], y = *step.scalars[get ? 2 : 1];
  const auto width = static_cast<float>(get ? step.planes[0]->width : step.y->width);
  const auto height = static_cast<float>(get ? step.planes[0]->height : step.y->height);
  if (!(x >= 0.0F && x < width && y >= 0.0F && y < height))
    return fail(Status::kFailed, (get ? "pixel.get" : "pixel.set") + std::string(" at column ") +
                                     number_text(x) + ", row " + number_text(y) +
                                     " is outside a register of " +
                                     shape_text(get ? *step.planes[0] : *step.y));
  const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
  if (get) {
    *step.variable = step.planes[0]->row(row)[column];
    return Status::kBudget;
  }
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open == Gate::kMismatch) return wrong_mask(*step.y);
  float* cell = &step.y->row(row)[column];
  if (open == Gate::kOpen && (mask == nullptr || mask[cell - step.y->data] != 0.0F)) *cell = *step.scalars[2];
  return Status::kBudget;
}

Status Vm::coordinates(const Step& step) {
  const float* mask = nullptr;
  const Gate open = gate(step, mask);
  if (open != Gate::kOpen) return open == Gate::kShut ? Status::kBudget : wrong_mask(*step.y);
  const bool column = step.op == Opcode::kCellX;
  for (std::uint32_t y = 0; y < step.y->height; ++y) {
    float* row = step.y->row(y);
    for (std::uint32_t x = 0; x < step.y->width; ++x)
      if (mask == nullptr || mask[row - step.y->data + x] != 0.0F)
        row[x] = static_cast<float>(column ? x : y);
  }
  return Status::kBudget;
}

Status Vm::flow(const Step& step) {
  bool jump = false;
  switch (step.op) {
    case Opcode::kNop:
      return Status::kBudget;
    case Opcode::kBoundary:
      edge_ = {step.edge.rule, *step.scalars[1]};
      return Status::kBudget;
    case Opcode::kCall:
      return call(step);
    case Opcode::kReturn:
      if (calls_.empty()) return Status::kEnded;
      next_ = calls_.back();
      calls_.pop_back();
      return Status::kBudget;
    case Opcode::kEnd:
      return Status::kEnded;
    case Opcode::kJump:
      jump = true;
      break;
    default:
      assert(is_conditional_jump(step.op) && "an opcode without an action");
      jump = jumps(step.op, *step.scalars[0], *step.scalars[1]);
      break;
  }
  if (jump) next_ = step.target;
  return Status::kBudget;
}

Status Vm::call(const Step& step) {
  if (calls_.size() == program::kMaxCallDepth)
    return fail(Status::kFailed, "calls are nested more than " + std::to_string(program::kMaxCallDepth) +
                                     " deep: does a routine call itself?");
  calls_.push_back(static_cast<std::uint32_t>(next_));
  next_ = step.target;
  return Status::kBudget;
}

Status Vm::wrong_mask(const Plane& plane) {
  return fail(Status::kFailed, "the mask in force is " + shape_text(masks_.mask()) +
                                   ", but the instruction writes a register of " + shape_text(plane));
}

Status Vm::fail(Status status, const std::string& text) {
  const program::Instruction& instruction = program_.code[next_ - 1];
  error_ = "error: " + text;
  if (instruction.source < program_.sources.size()) {
    const program::Source& source = program_.sources[instruction.source];
    error_ = program_.files[source.file] + ":" + std::to_string(source.line) + ": " + error_;
  }
  return status;
}

}  // namespace apron::vm
