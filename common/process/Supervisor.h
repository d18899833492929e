// Ends a command together with all that it has started.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace common {

// Becomes the program, with the environment, streams and process group of this process, but with the usual
// signals. Returns if it cannot be executed, with errno. `parent` gets the program killed by that signal when
// it ends.
void execute(const std::vector<std::string>& command, pid_t parent, int signal) noexcept;

struct Supervision {
  pid_t parent;
  // Called in a child of the supervisor, with its process id; executes the command and does not return.
  std::function<void(pid_t supervisor)> become_command;
  // The command's end of a socket on which it gets its input, or -1. A command that has input, or whose input
  // has ended, and that does nothing for ten seconds, or neither reads nor writes in a minute of its
  // processor time, is ended, with status kStalled.
  int input = -1;
  // How long the command may take to end when `parent` has ended.
  std::chrono::milliseconds grace_without_parent{300};
  // Called when all has ended because of SIGTERM or because `parent` has ended.
  std::function<void()> at_end_without_parent = nullptr;
};
constexpr int kStalled = 124;

// Called in a forked child, which becomes the supervisor of a command. The supervisor ends with the command,
// with its exit status or 128 + signal, and ends what the command has left. On SIGTERM it passes the signal
// on, and kills what remains after 1.5 s, or on another SIGTERM, or after a grace where `parent` has ended,
// which it detects in any case, even if the parent has dropped privileges. Processes in sessions of
// their own and those whose parents have ended do not escape: the supervisor adopts them. Without /proc, only
// the command itself is ended. Signals of a terminal reach the command, not the supervisor.
[[noreturn]] void supervise(const Supervision&) noexcept;

}  // namespace common
