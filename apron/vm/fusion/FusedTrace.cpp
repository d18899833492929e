#include "apron/vm/fusion/FusedTrace.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {

using program::BoundaryRule;

namespace {

// Arrays in which the time to bind a stage's rows matters, and the number of calls that are kept for them.
constexpr std::uint32_t kMaxScheduledRows = 64;
constexpr std::size_t kMaxScheduledCalls = 128, kCallsPerStageAndBlock = 4;

// row mod rows, not negative.
std::int64_t modulo(std::int64_t row, std::int64_t rows) {
  if (row >= 0 && row < rows) return row;
  const std::int64_t rest = row % rows;
  return rest < 0 ? rest + rows : rest;
}

// True if a stage reads its own cells only, with few operations, and so waits for memory.
bool is_bandwidth_bound(const Stage& stage) {
  return stage.ops.size() <= 2 * stage.streams.size() &&
         std::ranges::all_of(stage.streams, [](const RowStream& s) { return s.dy == 0; }) &&
         std::ranges::all_of(stage.ops, [](const MicroOp& op) {
           return std::ranges::all_of(op.operands, [](const MicroOperand& a) { return a.dx == 0; });
         });
}

// CPUs that halve vectors of 512 bits move more bytes in vectors of 256; others move as many.
InstructionSet isa_for(const FusionPlan& plan, InstructionSet isa) {
  const bool narrow =
      isa == InstructionSet::kAvx512 && plan.stages.size() == 1 && is_bandwidth_bound(plan.stages[0]);
  return narrow ? InstructionSet::kAvx2 : isa;
}

}  // namespace

FusedTrace::FusedTrace(const Trace& trace, ValueGraph graph, FusionPlan plan, const Environment& environment)
    : exit_(trace.exit),
      instruction_count_(trace.instructions.size()),
      mask_depth_(trace.mask_depth),
      call_depth_(trace.call_depth),
      graph_(std::move(graph)),
      stage_scalars_(graph_.scalar_slots.size()),
      plan_(std::move(plan)),
      cell_bytes_(static_cast<std::ptrdiff_t>(program::cell_bytes(plan_.type))),
      lanes_(lanes(plan_.type)),
      executor_(environment.executor),
      register_file_(environment.register_file),
      back_buffers_(environment.back_buffers),
      pads_stay_zero_(environment.pads_stay_zero) {
  for (const Stage& stage : plan_.stages) {
    compiled_stages_.push_back(StageJit::compile(stage, isa_for(plan_, environment.code_isa),
                                                 common_vector_count(stage), plan_.rows_per_iteration));
    stage_interpreters_.emplace_back(stage, plan_.buffers, executor_.kernels());
  }
  allocate_workers();
  allocate_schedules();
}

// Schedules are used if every call is generated code, and nothing happens between the calls.
void FusedTrace::allocate_schedules() {
  const auto is_call_alone = [&](std::size_t s) {
    const Stage& stage = plan_.stages[s];
    return compiled_stages_[s] && std::ranges::none_of(stage.results, [&](const auto& result) {
             return needs_padding(result, stage);
           });
  };
  const std::size_t blocks = plan_.height / plan_.block_rows + 2;
  const std::size_t calls = blocks * plan_.stages.size() * kCallsPerStageAndBlock;
  if (plan_.height > kMaxScheduledRows || plan_.slices > 1 || plan_.strip_columns != plan_.width) return;
  for (std::size_t s = 0; s < plan_.stages.size(); ++s)
    if (!is_call_alone(s)) return;
  for (Schedule& schedule : schedules_) {
    schedule.addresses.resize(plan_.buffers.size());
    schedule.calls.reserve(std::min(calls, kMaxScheduledCalls));
  }
}

// The schedule for the worker's buffers; nullptr if there is none, or it would have too many calls.
const FusedTrace::Schedule* FusedTrace::find_schedule(const Worker& worker) noexcept {
  if (schedules_.front().calls.capacity() == 0) return nullptr;
  for (const Schedule& schedule : schedules_)
    if (!schedule.calls.empty() &&
        std::equal(schedule.addresses.begin(), schedule.addresses.end(), worker.views.begin(),
                   [](const std::byte* address, const BufferView& view) { return address == view.data; }))
      return &schedule;
  Schedule& schedule = schedules_[oldest_schedule_];
  oldest_schedule_ = 1 - oldest_schedule_;
  std::ranges::transform(worker.views, schedule.addresses.begin(),
                         [](const BufferView& view) { return view.data; });
  schedule.calls.clear();
  recorded_schedule_ = &schedule;
  run_slice(0, worker);
  recorded_schedule_ = nullptr;
  if (schedule.calls.size() < schedule.calls.capacity()) return &schedule;
  for (Schedule& full : schedules_) full = {};
  return nullptr;
}

void FusedTrace::allocate_workers() {
  std::size_t scratch = 0;
  for (std::size_t s = 0; s < stage_interpreters_.size(); ++s)
    if (!compiled_stages_[s]) scratch = std::max(scratch, stage_interpreters_[s].scratch_floats());
  const std::size_t ring_floats = plan_.worker_cells * cell_bytes_ / sizeof(float) + 2 * kLanes;
  const std::size_t rings = (ring_floats + kLanes - 1) / kLanes * kLanes;
  worker_floats_ = rings + scratch + kLanes;
  workers_.resize(plan_.threads);
  for (Worker& worker : workers_) {
    worker.rings = plane_store_.allocate(static_cast<std::uint32_t>(worker_floats_), 1).data;
    worker.scratch = worker.rings + rings;
    worker.views.resize(plan_.buffers.size());
  }
  const auto columns = plan_.width + 4 * static_cast<std::uint32_t>(lanes_);
  const Plane row = plane_store_.allocate(columns, 1, plan_.type);
  const double value = plan_.boundary.rule == BoundaryRule::kValue ? plan_.boundary.value : 0.0;
  with_cell_type(plan_.type, [&](auto cell) {
    using T = decltype(cell);
    std::fill_n(row.cells<T>(0), columns, static_cast<T>(value));
  });
  boundary_row_ = row.row_bytes(0) + 2 * lanes_ * cell_bytes_;
  fill_index_planes();
  for (Worker& worker : workers_) {
    bind_buffers(worker, {});
    fill_margins(worker);
  }
  // With one strip the padding of the rings is at fixed columns and is filled once.
  if (has_constant_boundary() && plan_.strip_columns == plan_.width)
    for (const Worker& worker : workers_) pad_rings(worker, {0, plan_.width, 0});
}

void FusedTrace::fill_index_planes() {
  for (const RowBuffer& buffer : plan_.buffers) {
    const bool columns = buffer.kind == RowBuffer::Kind::kColumnIndex;
    if (!columns && buffer.kind != RowBuffer::Kind::kRowIndex) continue;
    Plane& plane = columns ? column_index_plane_ : row_index_plane_;
    plane = plane_store_.allocate(plan_.width, columns ? 1 : plan_.height);
    for (std::uint32_t y = 0; y < plane.height; ++y) {
      for (std::uint32_t x = 0; x < plane.width; ++x) plane.row(y)[x] = static_cast<float>(columns ? x : y);
      pad_row(plane.row_bytes(y), buffer.pad_columns, true, true);
    }
    index_plane_floats_ += plane.cell_count();
  }
}

std::vector<std::uint32_t> FusedTrace::double_buffered_registers() const {
  std::vector<std::uint32_t> registers;
  for (const RowBuffer& buffer : plan_.buffers)
    if (buffer.kind == RowBuffer::Kind::kDoubleBuffered) registers.push_back(buffer.reg);
  return registers;
}

std::size_t FusedTrace::memory_bytes() const noexcept {
  std::size_t bytes = (worker_floats_ * plan_.threads + index_plane_floats_) * sizeof(float);
  for (const Schedule& schedule : schedules_) bytes += schedule.calls.capacity() * sizeof(BoundCall);
  return bytes;
}

// True if the padding of the rings is constant. Stages write whole vectors, so the width must be a multiple
// of kLanes for them not to overwrite it.
bool FusedTrace::has_constant_boundary() const noexcept {
  return (plan_.boundary.rule == BoundaryRule::kZero || plan_.boundary.rule == BoundaryRule::kValue) &&
         plan_.width % static_cast<std::uint32_t>(lanes_) == 0;
}

bool FusedTrace::run(const ConstPlane& mask) noexcept {
  if (!evaluate_scalars()) return false;
  for (Worker& worker : workers_) bind_buffers(worker, mask);
  if (!pads_stay_zero_) pad_inputs();
  if (const Schedule* schedule = find_schedule(workers_[0])) {
    for (const BoundCall& bound : schedule->calls) bound.run(&bound.call);
  } else if (workers_.size() == 1) {
    for (unsigned slice = 0; slice < plan_.slices; ++slice) run_slice(slice, workers_[0]);
  } else {
    executor_.parallel_for(
        plan_.slices, [this](std::uint32_t slice, unsigned thread) { run_slice(slice, workers_[thread]); });
  }
  for (const RowBuffer& buffer : plan_.buffers)
    if (buffer.kind == RowBuffer::Kind::kDoubleBuffered)
      std::swap(register_file_.registers[buffer.reg], back_buffers_[buffer.reg]);
  for (const auto& [variable, slot] : graph_.variable_stores) *variable = graph_.scalar_slots[slot];
  return true;
}

// The columns [west, east) that a stage computes for a strip: with its halo, west aligned to whole vectors.
void FusedTrace::stage_columns(const Stage& stage, const Strip& strip, std::int64_t& west,
                               std::int64_t& east) const noexcept {
  west = std::max<std::int64_t>(0, round_down(strip.first - stage.halo_x + lanes_) - lanes_);
  east = std::min<std::int64_t>(plan_.width, strip.last + stage.halo_x);
}

// The greatest common divisor of the stage's vectors per row over all strips.
std::uint32_t FusedTrace::common_vector_count(const Stage& stage) const noexcept {
  std::int64_t common = 0;
  for (std::int64_t column = 0; column < plan_.width; column += plan_.strip_columns) {
    std::int64_t west = 0, east = 0;
    stage_columns(stage, {column, std::min<std::int64_t>(column + plan_.strip_columns, plan_.width), 0}, west,
                  east);
    common = std::gcd(common, round_up(east - west) / lanes_);
  }
  return static_cast<std::uint32_t>(common);
}

void FusedTrace::fill_margins(const Worker& worker) noexcept {
  const double value = plan_.boundary.rule == BoundaryRule::kValue ? plan_.boundary.value : 0.0;
  for (const BufferView& view : worker.views)
    for (std::int64_t k = 1; k <= -view.first_row; ++k)
      for (const std::int64_t row : {-k, static_cast<std::int64_t>(plan_.height) - 1 + k})
        with_cell_type(plan_.type, [&](auto cell) {
          using T = decltype(cell);
          std::fill_n(reinterpret_cast<T*>(view.data + row * view.pitch) - lanes_,
                      view.pitch / cell_bytes_ + lanes_, static_cast<T>(value));
        });
}

bool FusedTrace::evaluate_scalars() noexcept {
  for (const auto& [slot, variable] : graph_.variable_loads) graph_.scalar_slots[slot] = *variable;
  for (const ScalarInstruction& instruction : graph_.scalar_instructions)
    graph_.scalar_slots[instruction.destination] = program::evaluate_scalar(
        instruction.op, graph_.scalar_slots[instruction.sources[0]],
        graph_.scalar_slots[instruction.sources[1]], graph_.scalar_slots[instruction.sources[2]]);
  for (std::size_t i = 0; i < stage_scalars_.size(); ++i)
    stage_scalars_[i] = std::bit_cast<std::uint32_t>(static_cast<float>(graph_.scalar_slots[i]));
  for (const std::uint32_t slot : graph_.cell_slots) {
    const double value = graph_.scalar_slots[slot];
    if (!program::is_cell_value(plan_.type, value)) return false;
    const auto bits = static_cast<std::uint32_t>(static_cast<std::int64_t>(value));
    stage_scalars_[slot] = bits * (cell_bytes_ == 1 ? 0x01010101U : cell_bytes_ == 2 ? 0x00010001U : 1U);
  }
  return true;
}

FusedTrace::BufferView FusedTrace::plane_view(const ConstPlane& plane) const noexcept {
  // Never written where the plane is a mask or an input.
  return {reinterpret_cast<std::byte*>(const_cast<float*>(plane.data)), plane.pitch * cell_bytes_, 0, 0,
          static_cast<std::int64_t>(plan_.height)};
}

void FusedTrace::bind_buffers(Worker& worker, const ConstPlane& mask) const noexcept {
  const std::int64_t height = plan_.height;
  for (std::size_t i = 0; i < plan_.buffers.size(); ++i) {
    const RowBuffer& buffer = plan_.buffers[i];
    BufferView& view = worker.views[i];
    switch (buffer.kind) {
      case RowBuffer::Kind::kRegister:
      case RowBuffer::Kind::kInPlace:
        view = plane_view(register_file_.registers[buffer.reg]);
        break;
      case RowBuffer::Kind::kDoubleBuffered:
        if (!back_buffers_.empty()) view = plane_view(back_buffers_[buffer.reg]);
        break;
      case RowBuffer::Kind::kMask:
        view = plane_view(mask);
        break;
      case RowBuffer::Kind::kColumnIndex:
        view = plane_view(column_index_plane_);
        view.pitch = 0;
        break;
      case RowBuffer::Kind::kRowIndex:
        view = plane_view(row_index_plane_);
        break;
      case RowBuffer::Kind::kRing: {
        view = {reinterpret_cast<std::byte*>(worker.rings + kLanes) +
                    static_cast<std::ptrdiff_t>(buffer.offset) * cell_bytes_,
                static_cast<std::ptrdiff_t>(plan_.ring_pitch) * cell_bytes_, buffer.ring_rows, 0, 0};
        const bool holds_array =
            buffer.ring_rows == plan_.height && plan_.boundary.rule != BoundaryRule::kWrap;
        if (holds_array) {
          view.first_row = -std::int64_t{buffer.margin_rows};
          view.end_row = height + buffer.margin_rows;
        }
        break;
      }
    }
  }
}

void FusedTrace::pad_inputs() noexcept {
  for (const RowBuffer& buffer : plan_.buffers) {
    if (buffer.kind != RowBuffer::Kind::kRegister || buffer.pad_columns == 0) continue;
    const Plane& plane = register_file_.registers[buffer.reg];
    for (std::uint32_t y = 0; y < plan_.height; ++y)
      pad_row(plane.row_bytes(y), buffer.pad_columns, true, true);
  }
}

// Fills the padding of one row from its own cells under the boundary rule. `row` points to its first cell.
void FusedTrace::pad_row(std::byte* row, std::uint32_t pad_columns, bool west, bool east) const noexcept {
  with_cell_type(plan_.type, [&](auto cell) {
    pad_row_of(reinterpret_cast<decltype(cell)*>(row), pad_columns, west, east);
  });
}

template <class T>
void FusedTrace::pad_row_of(T* row, std::uint32_t pad_columns, bool west, bool east) const noexcept {
  const std::ptrdiff_t width = plan_.width;
  for (std::ptrdiff_t k = 1; k <= static_cast<std::ptrdiff_t>(pad_columns); ++k) {
    T w = plan_.boundary.rule == BoundaryRule::kValue ? static_cast<T>(plan_.boundary.value) : T{0}, e = w;
    if (plan_.boundary.rule == BoundaryRule::kReplicate) {
      if (west) w = row[0];
      if (east) e = row[width - 1];
    } else if (plan_.boundary.rule == BoundaryRule::kReflect) {
      if (west) w = row[k];
      if (east) e = row[width - 1 - k];
    } else if (plan_.boundary.rule == BoundaryRule::kWrap) {
      w = row[width - k];
      e = row[k - 1];
    }
    if (west) row[-k] = w;
    if (east) row[width - 1 + k] = e;
  }
}

std::byte* FusedTrace::cell_address(const BufferView& view, const Strip& strip, std::int64_t row,
                                    std::int64_t column) const noexcept {
  if (view.ring_rows == 0) return view.data + row * view.pitch + column * cell_bytes_;
  return view.data + modulo(row, view.ring_rows) * view.pitch + (column - strip.ring_origin) * cell_bytes_;
}

void FusedTrace::pad_rings(const Worker& worker, const Strip& strip) const noexcept {
  const bool west = strip.ring_origin == 0;
  const bool east = std::min<std::int64_t>(plan_.width, strip.last + plan_.ring_halo) == plan_.width;
  for (std::size_t i = 0; i < plan_.buffers.size(); ++i)
    for (std::uint32_t r = 0; plan_.buffers[i].pad_columns > 0 && r < plan_.buffers[i].ring_rows; ++r)
      pad_row(cell_address(worker.views[i], strip, r, 0), plan_.buffers[i].pad_columns, west, east);
}

// Runs all stages over one slice, strip by strip and block by block. Each stage trails the block by its skew.
void FusedTrace::run_slice(unsigned slice, const Worker& worker) noexcept {
  const auto height = static_cast<std::int64_t>(plan_.height);
  const std::int64_t top = height * slice / plan_.slices, bottom = height * (slice + 1) / plan_.slices;
  const bool wraps = plan_.boundary.rule == BoundaryRule::kWrap;
  const auto first_row = [&](const Stage& stage) {
    return wraps ? top - stage.halo_y : std::max<std::int64_t>(0, top - stage.halo_y);
  };
  const auto last_row = [&](const Stage& stage) {
    return wraps ? bottom + stage.halo_y : std::min(height, bottom + stage.halo_y);
  };
  std::int64_t begin = top, end = 0;
  for (const Stage& stage : plan_.stages) {
    begin = std::min(begin, first_row(stage));
    end = std::max(end, last_row(stage) + stage.skew);
  }
  for (std::int64_t column = 0; column < plan_.width; column += plan_.strip_columns) {
    const Strip strip{column, std::min<std::int64_t>(column + plan_.strip_columns, plan_.width),
                      std::max<std::int64_t>(0, column - plan_.ring_halo)};
    if (has_constant_boundary() && plan_.strip_columns != plan_.width) pad_rings(worker, strip);
    for (std::int64_t row = begin; row < end; row += plan_.block_rows)
      for (std::size_t s = 0; s < plan_.stages.size(); ++s) {
        const Stage& stage = plan_.stages[s];
        const std::int64_t first = std::max(first_row(stage), row - stage.skew);
        const std::int64_t last =
            std::min(last_row(stage), row - stage.skew + std::int64_t{plan_.block_rows});
        if (first < last) run_stage(s, worker, strip, first, last);
      }
  }
}

void FusedTrace::run_stage(std::size_t index, const Worker& worker, const Strip& strip, std::int64_t first,
                           std::int64_t last) noexcept {
  const Stage& stage = plan_.stages[index];
  std::int64_t west = 0, east = 0;
  stage_columns(stage, strip, west, east);
  StageCall call;
  call.scalar_slots = stage_scalars_.data();
  call.row_bytes = round_up(east - west) * cell_bytes_;
  while (first < last) {
    const StageJit::CompiledLoop* loop =
        compiled_stages_[index] ? &compiled_stages_[index]->loop_for(last - first) : nullptr;
    const std::uint32_t rows = loop != nullptr ? loop->rows_per_iteration : 1;
    const std::vector<RowStream>& row_streams = loop != nullptr ? loop->row_streams : stage.streams;
    call.iterations = std::min((last - first) / rows,
                               bind_row_streams(row_streams, rows, worker, strip, first, west, call));
    if (recorded_schedule_ != nullptr) {
      if (recorded_schedule_->calls.size() < recorded_schedule_->calls.capacity())
        recorded_schedule_->calls.push_back({loop->run, call});
    } else if (loop != nullptr) {
      loop->run(&call);
    } else {
      stage_interpreters_[index].run(call, worker.scratch);
    }
    if (recorded_schedule_ == nullptr)
      pad_results(stage, worker, strip, first, first + call.iterations * rows, west, east);
    first += call.iterations * rows;
  }
}

// Sets the row streams of `call` for an iteration that begins at this row. Returns how many iterations may
// use constant row steps from there.
std::int64_t FusedTrace::bind_row_streams(const std::vector<RowStream>& row_streams, std::uint32_t rows,
                                          const Worker& worker, const Strip& strip, std::int64_t row,
                                          std::int64_t column, StageCall& call) const noexcept {
  std::int64_t iterations = std::numeric_limits<std::int64_t>::max();
  for (std::size_t s = 0; s < row_streams.size(); ++s) {
    const BufferView& view = worker.views[row_streams[s].buffer];
    const std::int64_t at = row + row_streams[s].dy;
    std::ptrdiff_t pitch = view.pitch;
    std::int64_t rows_available = 0;
    if (at >= view.first_row && at < view.end_row) {
      call.row_start[s] =
          view.data + at * pitch + (column - (view.ring_rows > 0 ? strip.ring_origin : 0)) * cell_bytes_;
      rows_available = view.end_row - at;
    } else {
      rows_available = locate_row(row_streams[s], worker, strip, at, column, call.row_start[s], pitch);
    }
    iterations = std::min(iterations, (rows_available - 1) / rows + 1);
    call.row_step_bytes[s] = pitch * rows;
  }
  return iterations;
}

// Sets the address of the row's cell at `column` and its pitch, for a row that is not among those at a fixed
// distance. Returns the number of rows from there on that are addressed by that pitch.
std::int64_t FusedTrace::locate_row(const RowStream& stream, const Worker& worker, const Strip& strip,
                                    std::int64_t row, std::int64_t column, std::byte*& first,
                                    std::ptrdiff_t& pitch) const noexcept {
  const auto height = static_cast<std::int64_t>(plan_.height);
  const BufferView& view = worker.views[stream.buffer];
  pitch = view.pitch;
  if (plan_.boundary.rule == BoundaryRule::kWrap) {
    const std::int64_t rows = view.ring_rows > 0 ? view.ring_rows : height, at = modulo(row, rows);
    first = view.data + at * view.pitch + column * cell_bytes_;
    return rows - at;
  }
  if (row >= 0 && row < height) {
    const auto at = static_cast<std::uint32_t>(row);
    const std::uint32_t ring_row = at < view.ring_rows ? at : at % view.ring_rows;
    first = view.data + static_cast<std::ptrdiff_t>(ring_row) * view.pitch +
            (column - strip.ring_origin) * cell_bytes_;
    return std::min<std::int64_t>(height - row, view.ring_rows - ring_row);
  }
  switch (plan_.boundary.rule) {
    case BoundaryRule::kReplicate:
      first = cell_address(view, strip, row < 0 ? 0 : height - 1, column);
      pitch = 0;
      break;
    case BoundaryRule::kReflect:
      first = cell_address(view, strip, row < 0 ? -row : 2 * (height - 1) - row, column);
      return 1;
    default:
      first = boundary_row_;
      pitch = 0;
      break;
  }
  return row < 0 ? -row : std::numeric_limits<std::int64_t>::max();
}

// True if the padding of a result's rows must be written with them.
bool FusedTrace::needs_padding(const Stage::Result& result, const Stage& stage) const noexcept {
  const RowBuffer& buffer = plan_.buffers[stage.streams[result.stream].buffer];
  if (buffer.pad_columns == 0) return false;
  return buffer.kind == RowBuffer::Kind::kRing ? !has_constant_boundary() : !pads_stay_zero_;
}

// Updates the padding of the rows [first, last) that a stage has just written.
void FusedTrace::pad_results(const Stage& stage, const Worker& worker, const Strip& strip, std::int64_t first,
                             std::int64_t last, std::int64_t west, std::int64_t east) const noexcept {
  for (const Stage::Result& result : stage.results) {
    if (!needs_padding(result, stage)) continue;
    const std::uint32_t buffer = stage.streams[result.stream].buffer;
    for (std::int64_t row = first; row < last; ++row)
      pad_row(cell_address(worker.views[buffer], strip, row, 0), plan_.buffers[buffer].pad_columns, west == 0,
              east == plan_.width);
  }
}

}  // namespace apron::vm
