// Process identity beyond the pid, and liveness.
#pragma once

#include <cstdint>

namespace shm_protocol {

// (start time << 22) | pid: see layout.h. 0 is no process.
using ProcessIdentity = std::uint64_t;

// The word of the calling process. Throws Error(kSystem) when /proc cannot be read.
ProcessIdentity own_process_identity();

std::uint32_t pid_of(ProcessIdentity) noexcept;

// Whether exactly that process (not another one under a recycled pid) exists and is no zombie. A stopped
// process is alive. When /proc hides the process, an existing pid counts as alive. Does not allocate; about
// 10 µs.
bool is_alive(ProcessIdentity) noexcept;

}  // namespace shm_protocol
