// Ends a command together with all that it has started.
#pragma once

#include <sys/types.h>

#include <functional>

namespace common {

// Called in a forked child, which becomes the supervisor of a command: `become_command`, called in a child of
// its own with the supervisor's process id, executes the command and does not return. The supervisor ends
// with the command, with its exit status or 128 + signal, and ends what the command has left. On SIGTERM it
// passes the signal on, and kills what remains after 1.5 s, or on another SIGTERM, or after 0.3 s where
// `parent` has ended, which it notices however that ends. Processes in sessions of their own and those whose
// parents have ended do not escape: the supervisor adopts them. Without /proc, only the command itself is
// ended. Signals of a terminal reach the command, not the supervisor.
[[noreturn]] void supervise(pid_t parent,
                            const std::function<void(pid_t supervisor)>& become_command) noexcept;

}  // namespace common
