// Process identities that survive pid reuse, and liveness checks.
#pragma once

#include <cstdint>

namespace shm_protocol {

// (start time << 22) | pid, see layout.h. 0: no process.
using ProcessIdentity = std::uint64_t;

// The identity of the calling process. Throws Error(kSystem) if /proc cannot be read.
ProcessIdentity own_process_identity();

std::uint32_t pid_of(ProcessIdentity) noexcept;

// Returns whether that process (not another one with a recycled pid) exists and is not a zombie. A stopped
// process is alive. If /proc hides the process, an existing pid counts as alive. Does not allocate; takes
// about 10 µs.
bool is_alive(ProcessIdentity) noexcept;

}  // namespace shm_protocol
