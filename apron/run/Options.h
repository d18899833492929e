// The command line of `apron`, as values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/run/LocalHost.h"

namespace apron::run {

enum ExitStatus {
  kDone = 0,
  kRunFailed = 1,
  kWrongInput = 2,
  kPeerLost = 3,
  kSignalled = 128
};  // plus the signal

enum class Command { kRun, kCheck, kDisassemble, kFormat, kRepl };

struct Options {
  Command command = Command::kRun;
  std::string program;
  std::string surface;                    // --shm; "" for none
  std::uint32_t width = 64, height = 64;  // --size, without a surface
  std::optional<std::uint64_t> ticks;
  Parameters parameters;
  unsigned threads = 1;
  bool reconnect = false;
  bool local_profile = false;
  std::vector<std::string> include_paths;
  double wait_s = 5.0;
  std::string profile, cost_model;  // files; "" for none
  std::vector<std::string> files;  // of fmt
  std::string watch;               // a register to show; "" for none
  bool write = false, only_check = false;
};

// Reads the command line. When there is nothing to run, because help was asked for or the line is wrong,
// prints what is to be said and returns the exit status instead.
struct ParsedOptions {
  Options options;
  std::optional<int> exit_status;
};
ParsedOptions parse_options(int argc, char** argv);

}  // namespace apron::run
