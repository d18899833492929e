// Ctrl-C, SIGTERM and a closed terminal as a flag that the VM and every wait look at, so that the program
// leaves in order.
#pragma once

#include <atomic>

namespace apron::run {

// From here on the first SIGINT, SIGTERM or SIGHUP raises the flag; a second one ends the process at once. A
// SIGHUP that was ignored, as by nohup, stays so.
void catch_stop_signals();
const std::atomic<bool>& stop_flag() noexcept;
// Raised along with the stop flag, and by whoever wants to interrupt the program for a moment.
std::atomic<bool>& interrupt_flag() noexcept;
// Lowers the flag again and catches the next signal.
void clear_stop_signal();
int stop_signal() noexcept;  // the one that came, or 0

}  // namespace apron::run
