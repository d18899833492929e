// Executes a verified program: every register is a 2-D array, and one instruction operates on all its cells.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"
#include "apron/vm/Host.h"
#include "apron/vm/MaskStack.h"
#include "apron/vm/Plane.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/fusion/FusedTraceCache.h"
#include "apron/vm/kernels/Executor.h"
#include "apron/vm/kernels/FloodFill.h"
#include "apron/vm/kernels/Kernels.h"
#include "apron/vm/kernels/Random.h"

namespace apron::vm {

struct VmOptions {
  unsigned threads = 1;
  // Arrays with fewer cells run on the calling thread.
  std::size_t parallel_cells = std::size_t{1} << 15;
  // Polled between instructions, so that a signal handler can stop an endless loop; may be null.
  const std::atomic<bool>* stop = nullptr;
  // Refuses, as an endless loop, a tick of more than 10^8 instructions, or fewer for arrays of more than
  // 2000 cells: seconds to a minute of a core.
  bool refuse_endless_ticks = false;
  // The CPU must support it. Never changes a result.
  InstructionSet isa = best_instruction_set();
  // Null selects the kernels of `isa`; for tests.
  const KernelTable* kernels = nullptr;
  // Never changes a result.
  FusionOptions fusion{};
  // Counts and times every instruction; disables fusion. See Vm::set_profiling().
  bool enable_profiling = false;
};

// Accumulated cost of one instruction of the program: its processor time on the thread that calls run().
struct InstructionProfile {
  std::uint64_t executions = 0, nanoseconds = 0;
  std::uint64_t jumps = 0;  // executions after which another instruction than the next one follows
};

enum class Status {
  kRunning,      // the budget is exhausted
  kTick,         // a surface.step is complete
  kEnded,        // the program has ended
  kClosed,       // the surface closed the session in an orderly way
  kPeerLost,     // the surface process died
  kInterrupted,  // stopped by VmOptions::stop or by the host
  kRefused,      // invalid user input; see error()
  kFailed,       // the program or the host failed; see error()
};

// Results depend only on the program and on the host's data: not on the number of threads, nor on the CPU
// (except for a NaN's sign and payload). Not thread-safe. Only the constructor allocates, except for error
// messages, file names of numbered images, routines that recurse inside a `where`, the first write under a
// mask of another type of cells, and a register stack that grows beyond its previous maximum.
class Vm {
 public:
  // `program` must have passed program::verify(); `host` must outlive the VM. Throws std::bad_alloc.
  Vm(program::Program program, VmOptions options, Host& host);
  Vm(const Vm&) = delete;
  Vm& operator=(const Vm&) = delete;

  // Executes at most `budget` instructions and stops after the next surface.step. After kRunning and kTick
  // the next call continues; after kInterrupted it retries the instruction that did not complete. Every other
  // status is final: later calls return it again.
  Status run(std::uint64_t budget = std::numeric_limits<std::uint64_t>::max());

  // Starts again from the first instruction: variables, filters, random numbers, masks and stack are those of
  // a new VM, and registers keep their cells. With `fill_register(r, 0)` for every register, all that follows
  // is what a new VM does; without, where the program does not read the old cells (see
  // FlowAnalysis::is_live()). Does not call Host::restart().
  void restart();
  // The value must be one of the cells' type.
  void fill_register(std::size_t register_index, double value) noexcept;

  // Exchanges the storage of a register, of the register's shape and with the padding of PlaneStore, which
  // the program overwrites unless keeps_padding(). `back`, null unless has_back_buffer(): where the program
  // may leave the register's new cells, so that plane() is one of the two afterwards. The storage must
  // outlive the VM or the next exchange. Returns the previous storage.
  struct Storage {
    Plane front, back;
  };
  Storage bind_register(std::size_t register_index, const Storage& storage) noexcept;
  bool has_back_buffer(std::size_t register_index) const noexcept;
  // True if the padding of all planes stays zero, and must be zero in the storage of bind_register().
  bool keeps_padding() const noexcept { return keeps_padding_; }

  // One line, "file:line: error: ..."; empty unless the status is kRefused or kFailed.
  const std::string& error() const noexcept { return error_; }

  // ---- for the debugger and tests ----
  const program::Program& program() const noexcept { return program_; }
  // Index of the next instruction.
  std::size_t program_counter() const noexcept { return program_counter_; }
  std::uint64_t instructions_executed() const noexcept { return instructions_executed_; }
  // Indexed by instruction; empty if profiling was never enabled.
  const std::vector<InstructionProfile>& profile() const noexcept { return profile_; }
  // Keeps earlier counts. The first activation allocates.
  void set_profiling(bool on);
  std::size_t call_depth() const noexcept { return return_addresses_.size(); }
  Plane plane(std::size_t register_index) const noexcept { return register_file_.registers[register_index]; }
  double& variable(std::size_t index) noexcept { return register_file_.scalars[index]; }
  double variable(std::size_t index) const noexcept { return register_file_.scalars[index]; }

 private:
  void reserve_masks();
  FusedTrace* find_fused_trace(std::uint64_t budget) const noexcept;
  void allocate_scratch(DecodedInstruction& decoded);
  Plane scratch_plane(const Plane& like, CellType type, int number);

  // Says if the active mask allows a write to the plane; on kAllowed, `mask` is the mask to apply or null for
  // all cells: the cells have the plane's type.
  enum class WriteAccess { kAllowed, kSuppressed, kShapeMismatch };
  WriteAccess check_write_access(const DecodedInstruction& decoded, const Plane& to, const float*& mask);
  // write(mask) unless the active mask allows no write to the plane.
  template <class Write>
  Status write_masked(const DecodedInstruction& decoded, const Plane& to, const Write& write) {
    const float* mask = nullptr;
    const WriteAccess access = check_write_access(decoded, to, mask);
    if (access == WriteAccess::kAllowed) return write(mask);
    return access == WriteAccess::kSuppressed ? Status::kRunning : report_mask_mismatch(to);
  }
  template <Status (Vm::*write)(const DecodedInstruction&, const float* mask)>
  Status write_masked(const DecodedInstruction& decoded) {
    return write_masked(decoded, *decoded.destination,
                        [&](const float* mask) { return (this->*write)(decoded, mask); });
  }

  // Each returns kRunning to continue at program_counter_.
  Status execute(const DecodedInstruction& decoded);
  Status execute_profiled(std::size_t at);
  Status execute_elementwise(const DecodedInstruction& decoded, const float* mask);
  Status execute_conversion(const DecodedInstruction& decoded, const float* mask);
  bool has_boundary_value(CellType type) const noexcept;
  Status execute_shift(const DecodedInstruction& decoded, const float* mask);
  Status execute_reduction(const DecodedInstruction& decoded);
  Status execute_integer_reduction(const DecodedInstruction& decoded, Reduction kind);
  Status execute_mask_op(const DecodedInstruction& decoded);
  Status access_pixel(const DecodedInstruction& decoded);
  Status write_cell_coordinates(const DecodedInstruction& decoded, const float* mask);
  Status execute_array_op(const DecodedInstruction& decoded);
  Status execute_neighbourhood(const DecodedInstruction& decoded, const float* mask);
  Status scatter(const DecodedInstruction&, const float* mask);
  Status scatter_number(const DecodedInstruction&, const float* mask);
  Status multiply_matrix(const DecodedInstruction&, const float* mask);
  void copy_plane(Plane y, ConstPlane a, const float* mask) noexcept;
  Status reduce_integer_neighbours(const DecodedInstruction& decoded, const float* mask);
  Status filter_integers(const DecodedInstruction& decoded, const float* mask);
  Status set_filter_coefficient(const DecodedInstruction& decoded);
  Status draw_random(const DecodedInstruction& decoded);
  Status fill_random(const DecodedInstruction& decoded, const RandomStream& draw, const float* mask);
  Status push_register(const DecodedInstruction& decoded);
  Status pop_register(const DecodedInstruction& decoded);
  Status access_group_member(const DecodedInstruction& decoded);
  Status access_group_register(const DecodedInstruction& decoded, Plane reg);
  Status execute_control_flow(const DecodedInstruction& decoded);
  Status execute_loop_check(const DecodedInstruction& decoded);
  Status execute_call(const DecodedInstruction& decoded);
  Status execute_host_op(const DecodedInstruction& decoded);
  Status execute_host_read(const DecodedInstruction& decoded);
  Status fail_image_number(double number);
  ConstPlane floats_for_host(const DecodedInstruction& decoded, std::size_t operand);
  void notify_host(const DecodedInstruction& decoded);
  Status read_host_scalar(const DecodedInstruction& decoded);
  std::optional<double> host_scalar(const DecodedInstruction& decoded);
  Status to_status(HostStatus status);
  void print_value(const DecodedInstruction& decoded);
  HostStatus read_from_host(const DecodedInstruction& decoded, Plane to);
  std::string_view register_name(const DecodedInstruction& decoded) const;
  Status push_plugin_argument(const DecodedInstruction& decoded);
  Status execute_plugin(const DecodedInstruction& decoded);

  Status report_mask_mismatch(const Plane& plane);
  Status fail_cell_value(double value, CellType type);
  Status fail(Status status, const std::string& text);
  Status refuse_endless_tick();

  program::Program program_;
  const std::uint64_t max_tick_instructions_;  // 0: no limit
  Host& host_;
  Executor executor_;
  PlaneStore plane_store_;
  RegisterFile register_file_;
  std::vector<Plane> scratch_planes_;
  std::vector<float> row_results_;
  std::vector<std::int64_t> integer_row_results_;
  MaskStack masks_;
  std::vector<DecodedInstruction> decoded_;
  std::unique_ptr<FusedTraceCache> fused_traces_;
  std::vector<std::uint32_t> return_addresses_;
  BoundaryCondition boundary_{};
  RandomStream random_stream_{};
  // They hold the largest destination of a scatter: sums of floats, and sums of integers or counts.
  std::tuple<std::vector<double>, std::vector<std::uint32_t>> scatter_sums_;
  // The planes that the largest matrix product reads, then those that it writes; see MatrixProduct.
  std::vector<float*> matrix_planes_;
  std::vector<float> matrix_weights_;
  ConnectedComponents components_;
  std::vector<Plane> stack_, free_stack_planes_;
  std::size_t stack_bytes_ = 0;
  std::vector<PluginArgument> plugin_arguments_;
  std::size_t program_counter_ = 0;
  std::uint64_t instructions_executed_ = 0, executed_before_tick_ = 0;
  std::vector<std::vector<float>> initial_coefficients_;  // of the filters, if the program changes them
  std::vector<std::vector<double>> filter_elements_;      // as they were set, for registers of integers
  bool keeps_padding_ = false;
  bool profiling_enabled_ = false;
  std::vector<InstructionProfile> profile_;
  Status final_status_ = Status::kRunning;  // any other value is final
  std::string error_;
};

}  // namespace apron::vm
