#include "apron/vm/Vm.h"

#include <time.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "apron/program/CallSite.h"
#include "apron/program/LoopCheck.h"
#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/NumberFormat.h"
#include "apron/vm/kernels/Shift.h"
#include "common/arithmetic/StandardArithmetic.h"

namespace apron::vm {

using program::Opcode;

namespace {

// Processor time of the calling thread: waits, and other programs on its core, do not count.
std::uint64_t thread_time_ns() noexcept {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(time.tv_nsec);
}

std::uint64_t max_tick_instructions(const program::Program& program) noexcept {
  constexpr std::uint64_t kMin = 500'000, kMax = 100'000'000, kCells = 200'000'000'000;
  return std::clamp(kCells / program::max_register_cells(program), kMin, kMax);
}

}  // namespace

Vm::Vm(program::Program program, VmOptions options, Host& host)
    : program_(std::move(program)),
      max_tick_instructions_(options.refuse_endless_ticks ? max_tick_instructions(program_) : 0),
      host_(host),
      executor_(options.kernels != nullptr ? *options.kernels : *kernel_table(options.isa),
                std::max(options.threads, 1U), options.parallel_cells, options.stop),
      masks_(executor_) {
  std::uint32_t rows = 0;
  for (const program::Register& r : program_.registers) {
    register_file_.registers.push_back(plane_store_.allocate(r.width, r.height, r.type));
    rows = std::max(rows, r.height);
  }
  row_results_.resize(rows);
  if (std::ranges::any_of(program_.registers, [](const auto& r) { return program::is_integer(r.type); }))
    integer_row_results_.resize(rows);
  for (const program::Variable& v : program_.variables) register_file_.scalars.push_back(v.initial_value);
  register_file_.scalars.insert(register_file_.scalars.end(), program_.literals.begin(),
                                program_.literals.end());
  decoded_.reserve(program_.code.size());
  for (const program::Instruction& i : program_.code) {
    DecodedInstruction& decoded =
        decoded_.emplace_back(decode(program_, i, register_file_, executor_.kernels()));
    const bool needs_scratch =
        decoded.dispatch == DispatchKind::kHost || decoded.dispatch == DispatchKind::kArrayOp;
    if (needs_scratch) allocate_scratch(decoded);
    if (decoded.op == Opcode::kMatrixProduct) {
      const std::size_t y = program_.groups[decoded.groups[0]].members.size(),
                        x = program_.groups[decoded.groups[1]].members.size();
      matrix_planes_.reserve(std::max(matrix_planes_.capacity(), x + y));
      matrix_weights_.reserve(std::max(matrix_weights_.capacity(), x * (y + kMatrixRows - 1)));
    }
    if (decoded.op == Opcode::kScatter) {
      const auto grow = [cells = decoded.destination->cell_count()](auto& sums) {
        sums.resize(std::max(sums.size(), cells));
      };
      if (program::is_integer(decoded.type) || decoded.planes[1] == nullptr)
        grow(std::get<1>(scatter_sums_));
      else
        grow(std::get<0>(scatter_sums_));
    }
    if (decoded.op >= Opcode::kFlood && decoded.op <= Opcode::kSpreadNumber &&
        decoded.op != Opcode::kDistance)
      components_.reserve(decoded.destination->width, decoded.destination->height);
  }
  return_addresses_.reserve(program::kMaxCallDepth);
  plugin_arguments_.reserve(program::kMaxPluginArguments);
  reserve_masks();
  const auto has = [this](const auto& condition) { return std::ranges::any_of(program_.code, condition); };
  if (has([](const program::Instruction& i) { return i.op == Opcode::kFilterSet; }))
    for (const program::Filter& filter : program_.filters)
      initial_coefficients_.push_back(filter.coefficients);
  for (const program::Filter& filter : program_.filters)
    filter_elements_.emplace_back(filter.coefficients.begin(), filter.coefficients.end());
  keeps_padding_ = !has([this](const program::Instruction& i) {
    return i.op == Opcode::kBoundary && program_.literals[i.operands[0].index] != 0.0;
  }) && std::ranges::all_of(program_.registers,
                            [](const program::Register& r) { return r.width % lanes(r.type) == 0; });
  if (options.enable_profiling) {
    options.fusion.enabled = false;
    set_profiling(true);
  }
  fused_traces_ = std::make_unique<FusedTraceCache>(program_, decoded_, register_file_, executor_,
                                                    options.isa, options.fusion,
                                                    std::max(options.threads, 1U), options.parallel_cells);
}

// Staging for masked reads, the results of plugins, sums of neighbours, and the floats of a host that reads
// or writes a register of integers. io.array.… take the register's own type.
void Vm::allocate_scratch(DecodedInstruction& decoded) {
  if (decoded.op == Opcode::kRandomInt) return;
  const bool exchanges_floats = decoded.dispatch == DispatchKind::kHost && decoded.op != Opcode::kArrayOpen &&
                                decoded.op != Opcode::kArraySave;
  const bool is_converted = program::is_integer(decoded.type) && exchanges_floats;
  const CellType type = is_converted ? CellType::kFloat32 : decoded.type;
  const Plane* from = decoded.planes[0] != nullptr ? decoded.planes[0] : decoded.planes[1];
  if (decoded.destination != nullptr &&
      (decoded.masked || decoded.op == Opcode::kPlugin || program::is_integer(decoded.type)))
    decoded.scratch = scratch_plane(*decoded.destination, type, 0);
  else if (decoded.destination == nullptr && from != nullptr && is_converted)
    decoded.scratch = scratch_plane(*from, type, 0);
  if (decoded.dispatch == DispatchKind::kArrayOp && decoded.destination != nullptr &&
      program::is_integer(decoded.type))
    decoded.second_scratch = scratch_plane(*decoded.destination, type, 1);
}

// The number-th plane of that shape and type.
Plane Vm::scratch_plane(const Plane& like, CellType type, int number) {
  for (const Plane& plane : scratch_planes_)
    if (same_shape(plane, like) && plane.type == type && number-- == 0) return plane;
  return scratch_planes_.emplace_back(plane_store_.allocate(like.width, like.height, type));
}

void Vm::restart() {
  for (std::size_t i = 0; i < program_.variables.size(); ++i)
    register_file_.scalars[i] = program_.variables[i].initial_value;
  for (std::size_t i = 0; i < initial_coefficients_.size(); ++i) {
    program_.filters[i].coefficients = initial_coefficients_[i];
    std::ranges::copy(initial_coefficients_[i], filter_elements_[i].begin());
  }
  masks_.clear();
  return_addresses_.clear();
  boundary_ = {};
  random_stream_ = {};
  free_stack_planes_.insert(free_stack_planes_.end(), stack_.begin(), stack_.end());
  stack_.clear();
  plugin_arguments_.clear();
  program_counter_ = 0;
  instructions_executed_ = executed_before_tick_ = 0;
  final_status_ = Status::kRunning;
  error_.clear();
}

void Vm::fill_register(std::size_t register_index, double value) noexcept {
  const Plane plane = register_file_.registers[register_index];
  assert(program::is_cell_value(plane.type, value));
  with_cell_type(plane.type, [&](auto cell) {
    using T = decltype(cell);
    for (std::uint32_t y = 0; y < plane.height; ++y)
      std::fill_n(plane.cells<T>(y), plane.width, static_cast<T>(value));
  });
}

Vm::Storage Vm::bind_register(std::size_t register_index, const Storage& storage) noexcept {
  assert(same_shape_and_type(register_file_.registers[register_index], storage.front));
  const Plane back =
      storage.back.data != nullptr ? fused_traces_->bind_back_buffer(register_index, storage.back) : Plane();
  return {std::exchange(register_file_.registers[register_index], storage.front), back};
}

bool Vm::has_back_buffer(std::size_t register_index) const noexcept {
  return fused_traces_->has_back_buffer(register_index);
}

// Reserves as many mask planes of each shape as the program can have in force without recursion.
void Vm::reserve_masks() {
  std::map<std::tuple<std::uint32_t, std::uint32_t, CellType>, std::size_t> planes;
  for (const DecodedInstruction& decoded : decoded_) {
    const Plane* condition = decoded.planes[0];
    if (decoded.dispatch != DispatchKind::kMask || condition == nullptr) continue;
    std::size_t& count = planes[{condition->width, condition->height, condition->type}];
    if (count == 0) count = 2;  // the base mask, and the base mask combined with a condition
    if (decoded.op == Opcode::kMaskPush) count = std::min(count + 1, program::kMaxMaskDepth + 2);
  }
  for (const auto& [key, count] : planes)
    masks_.reserve(std::get<0>(key), std::get<1>(key), std::get<2>(key), count);
}

void Vm::set_profiling(bool on) {
  profiling_enabled_ = on;
  if (on) profile_.resize(program_.code.size());
}

Status Vm::run(std::uint64_t budget) {
  const common::StandardArithmetic arithmetic;
  if (final_status_ != Status::kRunning) return final_status_;
  const std::uint64_t left = max_tick_instructions_ - (instructions_executed_ - executed_before_tick_);
  const bool is_limited = max_tick_instructions_ != 0 && left <= budget;
  if (is_limited) budget = left;
  for (; budget > 0; --budget) {
    if (executor_.is_stopped()) return Status::kInterrupted;
    if (FusedTrace* fused = profiling_enabled_ ? nullptr : find_fused_trace(budget)) {
      if (fused->run(masks_.mask())) {
        program_counter_ = fused->exit();
        instructions_executed_ += fused->instruction_count();
        budget -= fused->instruction_count() - 1;
        continue;
      }
    }
    const std::size_t at = program_counter_;
    const Status status =
        profiling_enabled_ ? execute_profiled(program_counter_++) : execute(decoded_[program_counter_++]);
    ++instructions_executed_;
    if (status == Status::kRunning) continue;
    if (status == Status::kTick) {
      executed_before_tick_ = instructions_executed_;
      return status;
    }
    program_counter_ = at;
    if (status != Status::kInterrupted) final_status_ = status;
    return status;
  }
  return is_limited ? final_status_ = refuse_endless_tick() : Status::kRunning;
}

Status Vm::refuse_endless_tick() {
  error_ = program::format_call_site(program_, program_counter_) +
           "error: " + std::to_string(max_tick_instructions_) +
           " instructions without surface.step or sim.frame, which end a tick: an endless loop?";
  return Status::kRefused;
}

Status Vm::execute_profiled(std::size_t at) {
  const std::uint64_t start_ns = thread_time_ns();
  const Status status = execute(decoded_[at]);
  ++profile_[at].executions;
  profile_[at].jumps += program_counter_ != at + 1 ? 1 : 0;
  profile_[at].nanoseconds += thread_time_ns() - start_ns;
  return status;
}

// The fused trace that begins at program_counter_; null if it would exceed the budget, or a depth limit that
// its instructions check one by one.
FusedTrace* Vm::find_fused_trace(std::uint64_t budget) const noexcept {
  FusedTrace* fused = fused_traces_->find(static_cast<std::uint32_t>(program_counter_), masks_);
  if (fused == nullptr || fused->instruction_count() > budget) return nullptr;
  const bool fits = masks_.depth() + fused->mask_depth() <= program::kMaxMaskDepth &&
                    return_addresses_.size() + fused->call_depth() <= program::kMaxCallDepth;
  return fits ? fused : nullptr;
}

Status Vm::execute(const DecodedInstruction& decoded) {
  switch (decoded.dispatch) {
    case DispatchKind::kElementwise:
      return write_masked<&Vm::execute_elementwise>(decoded);
    case DispatchKind::kScalar: {
      const auto value = [&](std::size_t k) {
        return decoded.scalars[k] != nullptr ? *decoded.scalars[k] : 0.0;
      };
      *decoded.destination_variable = program::evaluate_scalar(decoded.op, value(0), value(1), value(2));
      return Status::kRunning;
    }
    case DispatchKind::kConvert:
      return write_masked<&Vm::execute_conversion>(decoded);
    case DispatchKind::kShift:
      return write_masked<&Vm::execute_shift>(decoded);
    case DispatchKind::kMask:
      return execute_mask_op(decoded);
    case DispatchKind::kReduce:
      return execute_reduction(decoded);
    case DispatchKind::kCellAccess:
      return decoded.op == Opcode::kCellX || decoded.op == Opcode::kCellY
                 ? write_masked<&Vm::write_cell_coordinates>(decoded)
                 : access_pixel(decoded);
    case DispatchKind::kArrayOp:
      return execute_array_op(decoded);
    case DispatchKind::kControlFlow:
      return execute_control_flow(decoded);
    case DispatchKind::kHost:
      return execute_host_op(decoded);
  }
  return Status::kFailed;
}

Vm::WriteAccess Vm::check_write_access(const DecodedInstruction& decoded, const Plane& to,
                                       const float*& mask) {
  mask = nullptr;
  if (!decoded.masked || masks_.active() == MaskStack::Active::kAll) return WriteAccess::kAllowed;
  if (masks_.active() == MaskStack::Active::kNone) return WriteAccess::kSuppressed;
  if (!same_shape(masks_.mask(), to)) return WriteAccess::kShapeMismatch;
  mask = masks_.mask_as(to.type).data;
  return WriteAccess::kAllowed;
}

Status Vm::execute_elementwise(const DecodedInstruction& decoded, const float* mask) {
  Block block(*decoded.destination, mask);
  for (std::size_t k = 0; k < program::kMaxOperands; ++k) {
    if (decoded.planes[k] != nullptr) block.source[k] = decoded.planes[k]->data;
    if (decoded.scalars[k] == nullptr) continue;
    if (!program::is_cell_value(decoded.type, *decoded.scalars[k]))
      return fail_cell_value(*decoded.scalars[k], decoded.type);
    if (program::is_integer(decoded.type))
      block.integer[k] = static_cast<std::int32_t>(*decoded.scalars[k]);
    else
      block.scalar[k] = static_cast<float>(*decoded.scalars[k]);
  }
  executor_.run_kernel(decoded.kernels[block.mask != nullptr ? 1 : 0], block);
  return Status::kRunning;
}

Status Vm::fail_cell_value(double value, CellType type) {
  NumberBuffer buffer;
  return fail(Status::kFailed, std::string(format_number(value, buffer)) + " is no " +
                                   std::string(program::cell_type_name(type)) +
                                   ", the type of the registers that it meets: a whole number from " +
                                   format_number(program::lowest_cell(type)) + " to " +
                                   format_number(program::highest_cell(type)));
}

Status Vm::execute_conversion(const DecodedInstruction& decoded, const float* mask) {
  convert_plane(executor_, *decoded.destination, *decoded.planes[0], decoded.op == Opcode::kConvertSaturated,
                mask);
  return Status::kRunning;
}

// True if the boundary's value is one of the cells.
bool Vm::has_boundary_value(CellType type) const noexcept {
  return boundary_.rule != program::BoundaryRule::kValue || program::is_cell_value(type, boundary_.value);
}

Status Vm::execute_shift(const DecodedInstruction& decoded, const float* mask) {
  const BoundaryCondition wrap{program::BoundaryRule::kWrap, 0.0};
  const BoundaryCondition boundary = decoded.op == Opcode::kRotate ? wrap : boundary_;
  Offset offset = decoded.offset;
  if (decoded.has_variable_offset) {
    const double dx = *decoded.scalars[1], dy = *decoded.scalars[2];
    const auto is_whole = [](double d) { return std::isfinite(d) && d == std::trunc(d); };
    if (!is_whole(dx) || !is_whole(dy))
      return fail(Status::kFailed, "the distance of a shift is a whole number, not " +
                                       std::string(format_number(std::fabs(is_whole(dx) ? dy : dx))));
    offset = {equivalent_distance(dx, decoded.destination->width, boundary.rule),
              equivalent_distance(dy, decoded.destination->height, boundary.rule)};
  }
  if (decoded.op == Opcode::kShift && !has_boundary_value(decoded.type))
    return fail_cell_value(boundary_.value, decoded.type);
  shift(executor_, *decoded.destination, *decoded.planes[0], offset, boundary, mask);
  return Status::kRunning;
}

Status Vm::execute_reduction(const DecodedInstruction& decoded) {
  const ConstPlane a = *decoded.planes[0];
  const Reduction kind = decoded.op == Opcode::kGlobalSum || decoded.op == Opcode::kGlobalMean
                             ? Reduction::kSum
                         : decoded.op == Opcode::kGlobalMin ? Reduction::kMin
                         : decoded.op == Opcode::kGlobalMax ? Reduction::kMax
                                                            : Reduction::kCount;
  if (program::is_integer(a.type)) return execute_integer_reduction(decoded, kind);
  const RowReduction row_reduction = executor_.kernels().reduction(kind);
  executor_.parallel_for_rows(a.height, a.width, [&](std::uint32_t first, std::uint32_t last) {
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
  double value = program::to_scalar(result);
  if (decoded.op == Opcode::kGlobalMean)
    value = static_cast<float>(result) / static_cast<float>(a.cell_count());
  if (decoded.op == Opcode::kGlobalAny) value = value != 0.0 ? 1.0 : 0.0;
  *decoded.destination_variable = value;
  return Status::kRunning;
}

// Exact up to 2^53, and the nearest number beyond.
Status Vm::execute_integer_reduction(const DecodedInstruction& decoded, Reduction kind) {
  const ConstPlane a = *decoded.planes[0];
  const IntegerRowReduction reduction =
      executor_.kernels().integers[index_of(a.type)].reductions[static_cast<std::size_t>(kind)];
  executor_.parallel_for_rows(a.height, a.width, [&](std::uint32_t first, std::uint32_t last) {
    reduction(reinterpret_cast<const float*>(a.row_bytes(first)), a.pitch, last - first, a.width,
              &integer_row_results_[first]);
  });
  const auto begin = integer_row_results_.begin(), end = begin + a.height;
  const std::int64_t result = kind == Reduction::kMin   ? *std::min_element(begin, end)
                              : kind == Reduction::kMax ? *std::max_element(begin, end)
                                                        : std::accumulate(begin, end, std::int64_t{0});
  double value = program::to_scalar(static_cast<double>(result));
  if (decoded.op == Opcode::kGlobalMean)
    value = program::to_scalar(static_cast<double>(result) / static_cast<double>(a.cell_count()));
  if (decoded.op == Opcode::kGlobalAny) value = result != 0 ? 1.0 : 0.0;
  *decoded.destination_variable = value;
  return Status::kRunning;
}

Status Vm::execute_mask_op(const DecodedInstruction& decoded) {
  const ConstPlane plane = decoded.planes[0] != nullptr ? ConstPlane(*decoded.planes[0]) : ConstPlane();
  switch (decoded.op) {
    case Opcode::kMaskOn:
      if (!masks_.set_base(plane))
        return fail(Status::kFailed,
                    "mask.on takes a register of " + format_shape(plane) + " inside a where of another size");
      break;
    case Opcode::kMaskOff:
      masks_.clear_base();
      break;
    case Opcode::kMaskPush:
      if (masks_.depth() == program::kMaxMaskDepth)
        return fail(Status::kFailed,
                    "where is nested more than " + std::to_string(program::kMaxMaskDepth) + " deep");
      if (plane.data == nullptr)
        masks_.push(static_cast<float>(*decoded.scalars[0]));
      else if (!masks_.push(plane))
        return fail(Status::kFailed, "where takes a register of " + format_shape(plane) +
                                         ", but the mask in force is " + format_shape(masks_.mask()));
      break;
    case Opcode::kMaskElse:
      masks_.invert_top();
      break;
    default:
      masks_.pop();
      break;
  }
  return Status::kRunning;
}

Status Vm::access_pixel(const DecodedInstruction& decoded) {
  const bool get = decoded.op == Opcode::kPixelGet;
  const double x = *decoded.scalars[get ? 1 : 0], y = *decoded.scalars[get ? 2 : 1];
  const auto width = static_cast<double>(get ? decoded.planes[0]->width : decoded.destination->width);
  const auto height = static_cast<double>(get ? decoded.planes[0]->height : decoded.destination->height);
  if (!(x >= 0.0 && x < width && y >= 0.0 && y < height))
    return fail(Status::kFailed, (get ? "pixel.get" : "pixel.set") + std::string(" at column ") +
                                     format_number(x) + ", row " + format_number(y) +
                                     " is outside a register of " +
                                     format_shape(get ? *decoded.planes[0] : *decoded.destination));
  if (x != std::trunc(x) || y != std::trunc(y))
    return fail(Status::kFailed, (get ? "pixel.get" : "pixel.set") + std::string(" at column ") +
                                     format_number(x) + ", row " + format_number(y) +
                                     ": columns and rows are whole numbers");
  const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
  if (get) {
    *decoded.destination_variable = cell_value(*decoded.planes[0], column, row);
    return Status::kRunning;
  }
  const float* mask = nullptr;
  const WriteAccess access = check_write_access(decoded, *decoded.destination, mask);
  if (access == WriteAccess::kShapeMismatch) return report_mask_mismatch(*decoded.destination);
  const double value = *decoded.scalars[2];
  if (!program::is_cell_value(decoded.type, value)) return fail_cell_value(value, decoded.type);
  with_cell_type(decoded.type, [&](auto zero) {
    using T = decltype(zero);
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(row) * decoded.destination->pitch + column;
    if (access == WriteAccess::kAllowed && (mask == nullptr || reinterpret_cast<const T*>(mask)[at] != T{0}))
      decoded.destination->cells<T>(0)[at] = static_cast<T>(value);
  });
  return Status::kRunning;
}

Status Vm::write_cell_coordinates(const DecodedInstruction& decoded, const float* mask) {
  const bool column = decoded.op == Opcode::kCellX;
  for (std::uint32_t y = 0; y < decoded.destination->height; ++y) {
    float* row = decoded.destination->row(y);
    const std::uint32_t width = decoded.destination->width;
    if (mask != nullptr) {
      for (std::uint32_t x = 0; x < width; ++x)
        if (mask[row - decoded.destination->data + x] != 0.0F) row[x] = static_cast<float>(column ? x : y);
    } else if (column) {
      for (std::uint32_t x = 0; x < width; ++x) row[x] = static_cast<float>(static_cast<std::int32_t>(x));
    } else {
      std::fill_n(row, width, static_cast<float>(y));
    }
  }
  return Status::kRunning;
}

Status Vm::execute_control_flow(const DecodedInstruction& decoded) {
  bool jump = false;
  switch (decoded.op) {
    case Opcode::kNop:
      return Status::kRunning;
    case Opcode::kBoundary:
      boundary_ = {decoded.boundary.rule, *decoded.scalars[1]};
      return Status::kRunning;
    case Opcode::kCall:
      return execute_call(decoded);
    case Opcode::kReturn:
      if (return_addresses_.empty()) return Status::kEnded;
      program_counter_ = return_addresses_.back();
      return_addresses_.pop_back();
      return Status::kRunning;
    case Opcode::kEnd:
      return Status::kEnded;
    case Opcode::kCheckFor:
    case Opcode::kCheckRepeat:
      return execute_loop_check(decoded);
    case Opcode::kJump:
      jump = true;
      break;
    default:
      assert(is_conditional_jump(decoded.op) && "an opcode without an action");
      jump = is_branch_taken(decoded.op, *decoded.scalars[0], *decoded.scalars[1]);
      break;
  }
  if (jump) program_counter_ = decoded.jump_target;
  return Status::kRunning;
}

Status Vm::execute_loop_check(const DecodedInstruction& decoded) {
  const auto& numbers = decoded.scalars;
  const std::string error = decoded.op == Opcode::kCheckFor
                                ? program::check_for(*numbers[0], *numbers[1], *numbers[2])
                                : program::check_repeat(*numbers[0]);
  return error.empty() ? Status::kRunning : fail(Status::kFailed, error);
}

Status Vm::execute_call(const DecodedInstruction& decoded) {
  if (return_addresses_.size() == program::kMaxCallDepth)
    return fail(Status::kFailed, "calls are nested more than " + std::to_string(program::kMaxCallDepth) +
                                     " deep: does a routine call itself?");
  return_addresses_.push_back(static_cast<std::uint32_t>(program_counter_));
  program_counter_ = decoded.jump_target;
  return Status::kRunning;
}

Status Vm::report_mask_mismatch(const Plane& plane) {
  return fail(Status::kFailed, "the mask in force is " + format_shape(masks_.mask()) +
                                   ", but the instruction writes a register of " + format_shape(plane));
}

Status Vm::fail(Status status, const std::string& text) {
  error_ = "error: " + text;
  const program::SourceLocation* source = program::find_location(program_, program_counter_ - 1);
  if (source == nullptr) return status;
  error_ = program_.files[source->file] + ":" + std::to_string(source->line) + ": " + error_;
  const program::Expansion* outermost = nullptr;
  for (; source->expansion != 0; source = &outermost->call_site)
    outermost = &program_.expansions[source->expansion];
  if (outermost != nullptr)
    error_ += " (in '" + outermost->macro + "', called at " + program_.files[source->file] + ":" +
              std::to_string(source->line) + ")";
  return status;
}

}  // namespace apron::vm
