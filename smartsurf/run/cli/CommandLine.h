// The command line of smartsurf: parses it, runs the subcommand, and reports every failure as one line and an
// exit status.
#pragma once

namespace smartsurf::run {

// The body of main(). Returns the exit status: 0 success, 1 failure, 2 invalid input, 3 the controller was
// lost, 128 + n after signal n.
int main(int argc, char** argv) noexcept;

}  // namespace smartsurf::run
