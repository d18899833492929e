// The command line of smartsurf: parses it, runs the subcommand, and reports every failure as one line and an
// exit status.
#pragma once

#include <functional>

namespace smartsurf::run {

// The body of main(). Returns the exit status: 0 success, 1 failure, 2 invalid input, 3 the controller was
// lost, 128 + n after signal n.
int main(int argc, char** argv) noexcept;

// The exit status of a part of it: its own, or that of the failure that it throws, which is printed.
int run_and_report(const std::function<int()>& command) noexcept;

}  // namespace smartsurf::run
