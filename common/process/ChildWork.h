// Work on files of unknown origin in a forked child process, which a damaged file may make crash, loop or
// grow.
#pragma once

#include <sys/resource.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace common {

struct ChildLimits {
  double cpu_s;
  std::size_t memory_bytes;                          // of address space, beyond what this process has
  std::vector<std::filesystem::path> readable = {};  // files, and folders with all that is below
  std::size_t answer_bytes = std::size_t{16} << 20;  // that `work` may return
};

struct ChildResult {
  // kOutOfMemory: it threw std::bad_alloc; kOutOfTime: it exceeded cpu_s; kFailed: it crashed, threw
  // something else, or returned more than answer_bytes; kStopped: the stop flag (StopSignals.h) was raised
  // meanwhile.
  enum class End { kReturned, kOutOfMemory, kOutOfTime, kFailed, kStopped } end;
  std::string bytes;  // what `work` returned
};

// Runs `work` in a child, which is confined to reading what the limits name (Confinement.h), has no open
// files but the standard streams, which lead nowhere, and ends with this process. Throws std::runtime_error
// if there can be no child, or none that is limited (UserError) and confined: the work is not done then.
ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits&);

// Limits this process's address space to what it has now and `bytes` more. Throws UserError if that cannot
// be, unless SMARTSURF_CONFINE is off.
void limit_address_space(std::size_t bytes);

// SIGPROF ends this process, which has just been forked, when it has used so much more processor time, and
// the kernel (RLIMIT_CPU) a second or two later if foreign code in it has switched that off. Throws UserError
// likewise.
void limit_processor_time(double seconds);
// True if that limit ended a process with this wait() status and usage.
bool ran_out_of_time(int status, const rusage& used, double seconds) noexcept;

// Processor time of the children that the calling thread has waited for here.
double child_time_s() noexcept;

}  // namespace common
