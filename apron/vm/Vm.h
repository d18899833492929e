// Executes a verified program: every register is a 2-D float array, and one instruction operates on all its
// cells.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"
#include "apron/vm/Executor.h"
#include "apron/vm/Host.h"
#include "apron/vm/MaskStack.h"
#include "apron/vm/Plane.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/fusion/FusedTraceCache.h"
#include "apron/vm/kernels/FloodFill.h"
#include "apron/vm/kernels/Random.h"

namespace apron::vm {

struct VmOptions {
  unsigned threads = 1;
  // Arrays with fewer cells stay on one thread.
  std::size_t parallel_cells = std::size_t{1} << 15;
  // Looked at before every instruction, so that a signal handler can stop an endless loop; may be null.
  const std::atomic<bool>* stop = nullptr;
  // Null: the best that this CPU has.
  const KernelTable* kernels = nullptr;
  // How instructions are run together; nothing here changes a result.
  FusionOptions fusion{};
  // Count and time every instruction; they run one at a time then. See Vm::set_profiling().
  bool enable_profiling = false;
};

// What one instruction of the program took so far.
struct InstructionProfile {
  std::uint64_t executions = 0, nanoseconds = 0;
};

enum class Status {
  kRunning,      // the budget is spent
  kTick,         // a surface.step is complete
  kEnded,        // the program came to its end
  kClosed,       // the surface ended the session in order
  kPeerLost,     // the surface died
  kInterrupted,  // stopped from outside
  kRefused,      // wrong input: error() says what
  kFailed,       // the program or the host failed: error() says what
};

// The result depends on the program and on what the host gives, and on nothing else: not on the number of
// threads, nor on the CPU (a NaN's sign and payload aside). Not thread-safe: one thread at a time may call
// it. Memory is allocated by the constructor only, except for messages, names of numbered pictures, for a
// routine that recurses inside a `where`, and for a stack of registers that grows deeper than before.
class Vm {
 public:
  // program must have passed program::verify(). host must outlive the VM. Throws std::bad_alloc.
  Vm(program::Program program, VmOptions options, Host& host);
  Vm(const Vm&) = delete;
  Vm& operator=(const Vm&) = delete;

  // Runs at most `budget` instructions, and no further than the next surface.step. After kBudget and kTick
  // another call goes on; after kInterrupted too, at the instruction that was not completed; after the others
  // it returns the same again.
  Status run(std::uint64_t budget = std::numeric_limits<std::uint64_t>::max());

  // One line, "file:line: error: …"; empty unless kRefused or kFailed.
  const std::string& error() const noexcept { return error_; }

  // ---- for the debugger and tests ----
  const program::Program& program() const noexcept { return program_; }
  std::size_t program_counter() const noexcept {
    return program_counter_;
  }  // index of the instruction to come
  std::uint64_t instructions_executed() const noexcept { return instructions_executed_; }
  // By instruction; empty if it was never profiled.
  const std::vector<InstructionProfile>& profile() const noexcept { return profile_; }
  // From here on; what was counted stays. Allocates the first time.
  void set_profiling(bool on);
  std::size_t call_depth() const noexcept { return return_addresses_.size(); }
  Plane plane(std::size_t register_index) const noexcept { return register_file_.registers[register_index]; }
  float& variable(std::size_t index) noexcept { return register_file_.scalars[index]; }
  float variable(std::size_t index) const noexcept { return register_file_.scalars[index]; }

 private:
  void reserve_masks();
  FusedTrace* find_fused_trace(std::uint64_t budget) const noexcept;
  Plane scratch_plane(const Plane& like);

  // What a write to the step's destination must obey.
  enum class WriteAccess { kAllowed, kSuppressed, kShapeMismatch };
  WriteAccess check_write_access(const DecodedInstruction& decoded, const float*& mask) const noexcept;

  // Each returns kBudget to go on with the instruction at next_.
  Status execute(const DecodedInstruction& decoded);
  Status execute_profiled(std::size_t at);
  Status execute_elementwise(const DecodedInstruction& decoded);
  Status execute_shift(const DecodedInstruction& decoded);
  Status execute_reduction(const DecodedInstruction& decoded);
  Status execute_mask_op(const DecodedInstruction& decoded);
  Status access_pixel(const DecodedInstruction& decoded);
  Status write_cell_coordinates(const DecodedInstruction& decoded);
  Status execute_array_op(const DecodedInstruction& decoded);
  Status execute_neighbourhood(const DecodedInstruction& decoded);
  void copy_plane(Plane y, ConstPlane a, const float* mask) noexcept;
  Status set_filter_coefficient(const DecodedInstruction& decoded);
  Status fill_random(const DecodedInstruction& decoded);
  Status push_register(const DecodedInstruction& decoded);
  Status pop_register(const DecodedInstruction& decoded);
  Status access_group_member(const DecodedInstruction& decoded);
  Status access_group_register(const DecodedInstruction& decoded, Plane reg);
  Status execute_control_flow(const DecodedInstruction& decoded);
  Status execute_call(const DecodedInstruction& decoded);
  Status execute_host_op(const DecodedInstruction& decoded);
  Status execute_host_read(const DecodedInstruction& decoded);
  Status set_surface_value(const DecodedInstruction& decoded, std::optional<double> value);
  Status to_status(HostStatus status);
  void print_value(const DecodedInstruction& decoded);
  HostStatus read_from_host(const DecodedInstruction& decoded, Plane to);
  Status save_numbered_image(const DecodedInstruction& decoded);
  std::string_view register_name(const DecodedInstruction& decoded) const;
  Status push_plugin_argument(const DecodedInstruction& decoded);
  Status execute_plugin(const DecodedInstruction& decoded);

  Status report_mask_mismatch(const Plane& plane);
  Status fail(Status status, const std::string& text);

  program::Program program_;
  const std::atomic<bool>* stop_;
  Host& host_;
  Executor executor_;
  PlaneStore plane_store_;
  RegisterFile register_file_;
  std::vector<Plane> scratch_planes_;  // one per shape that is filled before a mask is applied
  std::vector<float> row_results_;
  MaskStack masks_;
  std::vector<DecodedInstruction> decoded_;
  std::unique_ptr<FusedTraceCache> fused_traces_;
  std::vector<std::uint32_t> return_addresses_;  // return addresses
  BoundaryCondition boundary_{};
  RandomStream random_stream_{};
  ConnectedComponents components_;
  std::vector<Plane> stack_, free_stack_planes_;
  std::size_t stack_bytes_ = 0;
  std::vector<PluginArgument> plugin_arguments_;
  std::size_t program_counter_ = 0;
  std::uint64_t instructions_executed_ = 0;
  bool profiling_enabled_ = false;
  std::vector<InstructionProfile> profile_;
  Status final_status_ = Status::kRunning;  // set once the program can go no further
  std::string error_;
};

}  // namespace apron::vm
