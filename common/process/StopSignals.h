// SIGINT, SIGTERM, SIGHUP and SIGXCPU as flags that long-running work polls.
#pragma once

#include <atomic>
#include <stdexcept>

namespace common {

// Work has ended early because the stop flag was raised.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

// Installs the handlers and returns stop_flag(). The first signal raises both flags. Signals within the next
// half second belong to the same request, because a supervisor signals the process and its group; a later one
// ends the process at once with status 128 + signal, for work that does not poll. An ignored SIGHUP (nohup)
// stays ignored. The end of the process that SMARTSURF_PARENT names is a signal too (ParentWatch.h). SIGPIPE
// is ignored from here on: a closed pipe is a write error, not the end of the process.
const std::atomic<bool>& catch_stop_signals();

// Makes a write beyond the limit of the file size (ulimit -f) an error instead of the end of the process.
void report_file_size_errors() noexcept;

const std::atomic<bool>& stop_flag() noexcept;
// Raised together with the stop flag, and by callers that interrupt the work for a moment.
std::atomic<bool>& interrupt_flag() noexcept;

// The signal received, or 0.
int stop_signal() noexcept;
// 128 + the signal received; `status` when there was none or the run failed anyway.
int status_after_signals(int status) noexcept;

// Lowers the flags, so that the next signal counts as the first again.
void clear_stop_signal() noexcept;

}  // namespace common
