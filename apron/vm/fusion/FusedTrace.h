// A compiled trace: executes as one pass over the array instead of one pass per instruction.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/fusion/FusionPlan.h"
#include "apron/vm/fusion/StageInterpreter.h"
#include "apron/vm/fusion/Trace.h"
#include "apron/vm/fusion/ValueGraph.h"
#include "apron/vm/jit/StageJit.h"
#include "apron/vm/kernels/Executor.h"

namespace apron::vm {

class FusedTrace {
 public:
  struct Environment {
    Executor& executor;
    RegisterFile& register_file;
    // Indexed by register: the second buffer of a double-buffered register, exchanged with the first.
    std::vector<Plane>& back_buffers;
    InstructionSet code_isa = InstructionSet::kPortable;  // of the generated code; kPortable generates none
    bool pads_stay_zero = false;  // the padding of every plane is zero and never written
  };

  // Allocates; run() does not. The objects that `environment` refers to must outlive the fused trace.
  FusedTrace(const Trace& trace, ValueGraph graph, FusionPlan plan, const Environment& environment);

  // Leaves registers and variables as if the trace had been executed instruction by instruction. `mask` is
  // the mask in force, for a trace that reads it. Does nothing and returns false if a number meets registers
  // of integers that cannot hold it, which is an error of one of the instructions.
  [[nodiscard]] bool run(const ConstPlane& mask) noexcept;

  // The trace is valid only while the filter, which must outlive it, has these coefficients. Allocates.
  void require_filter(const program::Filter& filter, const std::vector<float>& coefficients) {
    required_filters_.push_back({&filter, coefficients});
  }
  bool filters_match() const noexcept {
    return std::ranges::all_of(required_filters_, [](const RequiredFilter& r) {
      return std::memcmp(r.filter->coefficients.data(), r.coefficients.data(),
                         r.coefficients.size() * sizeof(float)) == 0;
    });
  }

  // The instruction at which execution continues.
  std::uint32_t exit() const noexcept { return exit_; }
  std::uint64_t instruction_count() const noexcept { return instruction_count_; }
  // Maximum number of masks and calls open at once, beyond those at entry.
  std::size_t mask_depth() const noexcept { return mask_depth_; }
  std::size_t call_depth() const noexcept { return call_depth_; }
  std::uint32_t width() const noexcept { return plan_.width; }
  std::uint32_t height() const noexcept { return plan_.height; }
  CellType type() const noexcept { return plan_.type; }
  // The registers that the trace writes to a back buffer.
  std::vector<std::uint32_t> double_buffered_registers() const;
  std::size_t memory_bytes() const noexcept;

 private:
  struct RequiredFilter {
    const program::Filter* filter;
    std::vector<float> coefficients;
  };
  struct BufferView {             // a row buffer as seen by one worker
    std::byte* data = nullptr;    // row 0, column 0 of the array; for a ring, of the strip
    std::ptrdiff_t pitch = 0;     // in bytes
    std::uint32_t ring_rows = 0;  // 0 unless a ring
    // The rows [first_row, end_row) are stored one after the other, with the margins beyond the edges.
    std::int64_t first_row = 0, end_row = 0;
  };
  struct Worker {
    float* rings = nullptr;
    float* scratch = nullptr;
    std::vector<BufferView> views;
  };
  struct Strip {
    std::int64_t first = 0, last = 0;  // its own columns [first, last), without the halo
    std::int64_t ring_origin = 0;      // array column stored at column 0 of a ring
  };

  struct BoundCall {
    void (*run)(const StageCall*) = nullptr;
    StageCall call;
  };
  // The calls of a pass over the array while the buffers have these addresses.
  struct Schedule {
    std::vector<std::byte*> addresses;
    std::vector<BoundCall> calls;
  };

  void allocate_workers();
  void allocate_schedules();
  const Schedule* find_schedule(const Worker& worker) noexcept;
  bool needs_padding(const Stage::Result& result, const Stage& stage) const noexcept;
  std::uint32_t common_vector_count(const Stage& stage) const noexcept;
  void stage_columns(const Stage& stage, const Strip& strip, std::int64_t& west,
                     std::int64_t& east) const noexcept;
  void fill_index_planes();
  void fill_margins(const Worker& worker) noexcept;
  bool evaluate_scalars() noexcept;
  template <class T>
  void pad_row_of(T* row, std::uint32_t pad_columns, bool west, bool east) const noexcept;
  std::int64_t round_down(std::int64_t columns) const noexcept { return columns / lanes_ * lanes_; }
  std::int64_t round_up(std::int64_t columns) const noexcept { return round_down(columns + lanes_ - 1); }
  BufferView plane_view(const ConstPlane& plane) const noexcept;
  void bind_buffers(Worker& worker, const ConstPlane& mask) const noexcept;
  void pad_inputs() noexcept;
  void run_slice(unsigned slice, const Worker& worker) noexcept;
  void run_stage(std::size_t stage, const Worker& worker, const Strip& strip, std::int64_t first,
                 std::int64_t last) noexcept;
  std::int64_t bind_row_streams(const std::vector<RowStream>& row_streams, std::uint32_t rows,
                                const Worker& worker, const Strip& strip, std::int64_t row,
                                std::int64_t column, StageCall& call) const noexcept;
  std::int64_t locate_row(const RowStream& stream, const Worker& worker, const Strip& strip, std::int64_t row,
                          std::int64_t column, std::byte*& first, std::ptrdiff_t& pitch) const noexcept;
  std::byte* cell_address(const BufferView& view, const Strip& strip, std::int64_t row,
                          std::int64_t column) const noexcept;
  void pad_results(const Stage& stage, const Worker& worker, const Strip& strip, std::int64_t first,
                   std::int64_t last, std::int64_t west, std::int64_t east) const noexcept;
  void pad_rings(const Worker& worker, const Strip& strip) const noexcept;
  void pad_row(std::byte* row, std::uint32_t pad_columns, bool west, bool east) const noexcept;
  bool has_constant_boundary() const noexcept;

  std::uint32_t exit_;
  std::uint64_t instruction_count_;
  std::size_t mask_depth_, call_depth_;
  std::vector<RequiredFilter> required_filters_;
  ValueGraph graph_;
  std::vector<std::uint32_t> stage_scalars_;  // the slots' bits, for the array pass
  FusionPlan plan_;
  const std::ptrdiff_t cell_bytes_;
  const std::int64_t lanes_;
  Executor& executor_;
  RegisterFile& register_file_;
  std::vector<Plane>& back_buffers_;
  bool pads_stay_zero_;
  std::vector<std::optional<StageJit>> compiled_stages_;  // nullopt where a stage is interpreted
  std::vector<StageInterpreter> stage_interpreters_;
  PlaneStore plane_store_;
  std::vector<Worker> workers_;
  // Registers alternate between two buffers, so that two schedules suffice. Large arrays have none (no
  // capacity).
  std::array<Schedule, 2> schedules_;
  std::size_t oldest_schedule_ = 0;
  Schedule* recorded_schedule_ = nullptr;  // takes the calls instead of their execution
  std::byte* boundary_row_ = nullptr;      // a row filled with the constant boundary value
  // One row that holds the column indices; a plane that holds each cell's row index.
  Plane column_index_plane_, row_index_plane_;
  std::size_t worker_floats_ = 0, index_plane_floats_ = 0;
};

}  // namespace apron::vm
