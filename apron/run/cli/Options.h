// The command line of `apron`, as values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/run/host/LocalHost.h"
#include "common/process/ExitStatus.h"

namespace apron::run {

enum class Subcommand { kRun, kCheck, kDisassemble, kFormat, kRepl };

// A picture of the window's contents, made without a display.
struct Screenshot {
  std::string file;
  std::optional<std::uint64_t> tick;  // nothing: at the end of the run
};

// The window's size and place; 0: chosen.
struct WindowGeometry {
  int width = 0, height = 0;
  std::optional<std::pair<int, int>> position;  // on the screen
  bool beside_simulator = false;                // the simulator's window, on its right
};

struct Options {
  Subcommand subcommand = Subcommand::kRun;
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
  bool window = false, hold = false;
  WindowGeometry geometry;
  std::string show;  // a register
  std::vector<Screenshot> screenshots;
  std::string video;               // a file; "" for none
  std::vector<std::string> files;  // of fmt
  std::string watch;               // a register to show in the terminal; "" for none

  std::vector<std::string> cameras;  // in place of /dev/video0, /dev/video1, …
  bool timers = false;               // they have a clock, also without a window

  bool uses_ui() const { return window || !screenshots.empty() || !video.empty(); }
  bool write = false, check_only = false;
};

// Reads the command line. When there is nothing to run, because help was asked for or the line is wrong,
// prints what is to be said and returns the exit status instead.
struct ParsedOptions {
  Options options;
  std::optional<int> exit_status;
};
ParsedOptions parse_options(int argc, char** argv);

}  // namespace apron::run
