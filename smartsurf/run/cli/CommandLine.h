// The command line of smartsurf: parses it, runs the command, and turns every failure into one line and a
// status.
#pragma once

namespace smartsurf::run {

// What main() does. Returns the exit status: 0 done, 1 the run failed, 2 the user's input was wrong, 3 the
// peer was lost.
int main(int argc, char** argv) noexcept;

}  // namespace smartsurf::run
