// Parses the command line of `apron`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/run/host/LocalHost.h"
#include "apron/run/media/SavedRegisters.h"
#include "apron/vm/kernels/Kernels.h"
#include "common/process/ExitStatus.h"

namespace apron::run {

enum class Subcommand {
  kRun,
  kCheck,
  kDisassemble,
  kFormat,
  kRepl,
  kImport,
  kCompile,
  kDebug,
  kLanguageServer
};

// An off-screen picture of the window's contents.
struct Screenshot {
  std::string file;
  std::optional<std::uint64_t> tick;  // nullopt: at the end of the run
};

// The window's size and position.
struct WindowGeometry {
  int width = 0, height = 0;                    // pixels; 0: default
  std::optional<std::pair<int, int>> position;  // x and y on the screen, pixels
  bool beside_simulator = false;                // to the right of the simulator's window
};

struct Options {
  Subcommand subcommand = Subcommand::kRun;
  std::string program;
  std::string output;                     // import --output; empty for standard output
  std::string picture;                    // import --picture
  std::string surface;                    // --shm; empty for none
  std::uint32_t width = 64, height = 64;  // --size, without a surface
  std::optional<std::uint64_t> ticks;
  Parameters parameters;
  unsigned threads = 1;
  vm::InstructionSet isa = vm::best_instruction_set();
  bool reconnect = false;
  bool local_check = false;  // check --local
  std::string original;      // --original: the library that stands for the original's, or ""
  std::vector<std::string> include_paths;
  std::string palettes;  // a file; empty for palettes.txt beside the program, if there is one
  double wait_s = 5.0;
  std::string profile, cost_model;  // files; empty for none
  bool window = false, hold = false, reset_layout = false;
  WindowGeometry geometry;
  std::string show;  // a register
  std::vector<Screenshot> screenshots;
  std::string video;  // a file; empty for none
  std::vector<SavedRegister> saved;
  std::vector<std::string> files;  // the inputs of fmt
  std::string watch;               // a register to show in the terminal; empty for none
  // --show-registers: names for the simulator that started this process, and where it reads them; −1:
  // nowhere.
  std::string shown_registers;
  std::string drawn_register;  // by the simulator's --cells, or ""
  int shown_descriptor = -1;

  FrameRate frame_rate;                      // without a surface
  std::vector<KeyPress> keys;                // --keys
  std::vector<std::string> allowed_folders;  // --allow: where the program may read and write, besides its own
  std::vector<std::string> modules;          // --module: native modules that the program may load
  std::vector<std::string> cameras;          // replace /dev/video0, /dev/video1, …
  bool timers = false;                       // timers measure wall time even without a window

  // Options of `apron compile`.
  std::uint32_t tile_width = 0, tile_height = 0;  // --tile; 0: the whole table
  std::uint32_t halo = 1, unroll = 20000;
  std::string name;                                  // --name; empty: from the output file
  std::optional<std::vector<std::string>> channels;  // --channels
  double link_baud = 0.0, rate_hz = 60.0, turnaround_s = 20e-6;

  bool uses_ui() const { return window || !screenshots.empty() || !video.empty(); }
  bool write = false, check_only = false;  // of fmt
};

// Parses the command line. If there is nothing to run (help, version or an error), prints the text and sets
// exit_status.
struct ParsedOptions {
  Options options;
  std::optional<int> exit_status;
};
ParsedOptions parse_options(int argc, char** argv);

}  // namespace apron::run
