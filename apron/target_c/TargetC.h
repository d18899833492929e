// Compiles a local program to C99 for the boards of a table, each of which holds one tile of its cells.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"

namespace apron::target_c {

struct Options {
  std::string name = "program";           // prefix of the names in the generated code: a C identifier
  std::uint32_t columns = 64, rows = 64;  // of the table
  std::uint32_t tile_columns = 64, tile_rows = 64;
  std::uint32_t halo = 1;                            // cells that one exchange brings from a neighbour
  std::uint32_t unroll = 20000;                      // instructions after which a loop is no longer unrolled
  std::map<std::string, float> parameters;           // sliders and switches that differ from their defaults
  std::optional<std::vector<std::string>> channels;  // of the surface; empty: those that the program names
  // The link to each neighbour, for the budget; 0: unchecked.
  double link_baud = 0.0, rate_hz = 60.0, turnaround_s = 20e-6;
};

// The cost of one tick: the most of each quantity; of a loop whose number of passes only run time shows, one
// pass.
struct Report {
  std::size_t rounds = 0, waits = 0;  // a round whose values need corners waits twice
  std::size_t edge_bytes = 0;         // in sequence: messages to different sides travel at once
  bool has_open_loops = false;
  std::size_t plane_bytes = 0, strip_bytes = 0, scalar_bytes = 0, channel_bytes = 0;
  std::size_t kernels = 0, regions = 0;
  bool needs_double = false;
};

struct Generated {
  std::string source, header;
  Report report;
  std::vector<std::string> warnings;
};

// `header_file` is the name by which the source includes the header. Throws common::UserError for what boards
// cannot execute, one line each with file and line, and for a link that is too slow. The program must pass
// verify().
Generated generate(const program::Program& program, const Options& options, const std::string& header_file);

}  // namespace apron::target_c
