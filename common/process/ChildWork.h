// Work on files of unknown origin in a forked child process, which a damaged file may make crash, loop or
// grow.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace common {

struct ChildLimits {
  double cpu_s;
  std::size_t memory_bytes;  // of address space, beyond what this process has
};

struct ChildResult {
  // kFailed: it crashed, threw or exceeded a limit; kStopped: the stop flag (StopSignals.h) was raised
  // meanwhile.
  enum class End { kReturned, kFailed, kStopped } end;
  std::string bytes;  // what `work` returned
};

// Runs `work` in a child, which has no other effect on this process, no open files but the standard streams,
// which lead nowhere, and ends with this process. Throws std::runtime_error if there can be no child: the
// work is not done here then.
ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits&);

// Processor time of the children that the calling thread has waited for here.
double child_time_s() noexcept;

}  // namespace common
