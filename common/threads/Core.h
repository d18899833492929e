// The processor core that a thread runs on, and how many threads want one.
//
// Schedulers may leave two threads of a team on one core while another is idle: each runs for so short a time
// before it waits for the other that their caches count as hot, which keeps them from being moved, on Linux
// for tens of milliseconds. Threads that wait for each other therefore publish the core on which they run,
// and one of two that share a core leaves it.
#pragma once

namespace common {

// Returns the core of the calling thread; −1 if unknown.
int current_core() noexcept;

// Moves the calling thread to another core that it may use, if there is any; after that it may use the same
// ones as before.
void leave_core() noexcept;

// Threads of all programs on the machine that run or wait for a core, this one included, and the machine's
// cores; 0 and 0 if unknown. Reads a file of the system, in some 7 µs.
struct CoreDemand {
  int runnable_threads, cores;
};
CoreDemand core_demand() noexcept;

}  // namespace common
