// How a process ends where no exception may leave: in a destructor, or in a library's noexcept function.
#pragma once

namespace common {

// From here on, an allocation that fails there ends the process with one line and kFailed instead of SIGABRT. Any other
// exception there is a bug and still aborts. `program` begins the line and must outlive the process.
void report_exhausted_memory(const char* program) noexcept;

}  // namespace common
