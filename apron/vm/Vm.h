// Runs a verified program: every register a 2-D float array, one instruction over all its cells at a time.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Executor.h"
#include "apron/vm/Host.h"
#include "apron/vm/MaskStack.h"
#include "apron/vm/Plane.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/Propagation.h"
#include "apron/vm/Random.h"
#include "apron/vm/Segments.h"
#include "apron/vm/Step.h"

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
  FuseOptions fuse{};
  // Count and time every instruction; they run one at a time then. See Vm::set_profiling().
  bool profile = false;
};

// What one instruction of the program took so far.
struct Spent {
  std::uint64_t count = 0, nanoseconds = 0;
};

enum class Status {
  kBudget,       // the budget is spent
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
  std::size_t next() const noexcept { return next_; }  // index of the instruction to come
  std::uint64_t executed() const noexcept { return executed_; }
  // By instruction; empty if it was never profiled.
  const std::vector<Spent>& spent() const noexcept { return spent_; }
  // From here on; what was counted stays. Allocates the first time.
  void set_profiling(bool on);
  std::size_t call_depth() const noexcept { return calls_.size(); }
  Plane plane(std::size_t register_index) const noexcept { return storage_.registers[register_index]; }
  float& variable(std::size_t index) noexcept { return storage_.scalars[index]; }
  float variable(std::size_t index) const noexcept { return storage_.scalars[index]; }

 private:
  void reserve_masks();
  Segment* segment(std::uint64_t budget) const noexcept;
  Plane scratch(const Plane& like);

  // What a write to the step's destination must obey.
  enum class Gate { kOpen, kShut, kMismatch };
  Gate gate(const Step& step, const float*& mask) const noexcept;

  // Each returns kBudget to go on with the instruction at next_.
  Status execute(const Step& step);
  Status measure(std::size_t at);
  Status elementwise(const Step& step);
  Status shift_image(const Step& step);
  Status reduce(const Step& step);
  Status change_mask(const Step& step);
  Status pixel(const Step& step);
  Status coordinates(const Step& step);
  Status array_step(const Step& step);
  Status neighbourhood(const Step& step);
  void copy(Plane y, ConstPlane a, const float* mask) noexcept;
  Status set_filter(const Step& step);
  Status random(const Step& step);
  Status push(const Step& step);
  Status pop(const Step& step);
  Status element(const Step& step);
  Status element_register(const Step& step, Plane reg);
  Status flow(const Step& step);
  Status call(const Step& step);
  Status host_call(const Step& step);
  Status read_plane(const Step& step);
  Status surface_value(const Step& step, std::optional<double> value);
  Status outcome(HostStatus status);
  void print_value(const Step& step);
  HostStatus read(const Step& step, Plane to);
  Status save_numbered(const Step& step);
  std::string_view register_name(const Step& step) const;
  Status plugin_with(const Step& step);
  Status plugin(const Step& step);

  Status wrong_mask(const Plane& plane);
  Status fail(Status status, const std::string& text);

  program::Program program_;
  const std::atomic<bool>* stop_;
  Host& host_;
  Executor executor_;
  PlaneStore store_;
  Storage storage_;
  std::vector<Plane> scratch_;  // one per shape that is filled before a mask is applied
  std::vector<float> row_results_;
  MaskStack masks_;
  std::vector<Step> steps_;
  std::unique_ptr<Segments> segments_;
  std::vector<std::uint32_t> calls_;  // return addresses
  Edge edge_{};
  Draw draw_{};
  Objects objects_;
  std::vector<Plane> stack_, free_stack_;
  std::size_t stack_bytes_ = 0;
  std::vector<PluginArgument> plugin_arguments_;
  std::size_t next_ = 0;
  std::uint64_t executed_ = 0;
  bool profiling_ = false;
  std::vector<Spent> spent_;
  Status final_ = Status::kBudget;  // set once the program can go no further
  std::string error_;
};

}  // namespace apron::vm
