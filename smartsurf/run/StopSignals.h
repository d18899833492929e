// Ctrl-C and its like, as a flag that long work looks at.
#pragma once

#include <atomic>

namespace smartsurf::run {

// From now on SIGINT, SIGTERM and SIGHUP (unless it was ignored, as by nohup) raise the flag; a second one
// ends the process at once, for work that does not look. SIGPIPE is ignored.
const std::atomic<bool>& catch_stop_signals();
// 128 + the signal that came, or `status` when none did or it is a failure.
int status_after_signals(int status);

}  // namespace smartsurf::run
