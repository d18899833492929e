// `apron compile`.
#include <fmt/format.h>

#include "apron/run/cli/Commands.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/target_c/TargetC.h"
#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"
#include "common/files/Inputs.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

target_c::Options target_options(const Options& options) {
  target_c::Options result;
  result.name = options.name;
  result.columns = options.width;
  result.rows = options.height;
  result.tile_columns = options.tile_width;
  result.tile_rows = options.tile_height;
  result.halo = options.halo;
  result.unroll = options.unroll;
  result.parameters = {options.parameters.begin(), options.parameters.end()};
  result.channels = options.channels;
  result.link_baud = options.link_baud;
  result.rate_hz = options.rate_hz;
  result.turnaround_s = options.turnaround_s;
  return result;
}

std::string report_text(const Options& options, const target_c::Report& report) {
  std::string text = fmt::format(
      "tile: {}x{} of a table of {}x{}\n"
      "state: {} bytes: planes {}, edges {}, channels {}, scalars {}\n",
      options.tile_width, options.tile_height, options.width, options.height,
      report.plane_bytes + report.strip_bytes + report.channel_bytes + report.scalar_bytes,
      report.plane_bytes, report.strip_bytes, report.channel_bytes, report.scalar_bytes);
  if (report.needs_double) text += "mathematical functions: need a double of 64 bits\n";
  if (options.tile_width == options.width && options.tile_height == options.height) return text;
  return text + fmt::format("{}: {} rounds, {} waits, {} bytes in sequence\n",
                            report.has_open_loops ? "edges of a tick, each open loop once"
                                                  : "edges of a tick, at most",
                            report.rounds, report.waits, report.edge_bytes);
}

}  // namespace

int compile_for_boards(const Options& options) {
  const std::optional<program::Program> program = compile_or_report(options, options.width, options.height);
  if (!program) return common::kUserError;
  check_parameters(options, *program);
  const std::string header = options.output.substr(0, options.output.size() - 2) + ".h";
  common::require_separate_outputs(std::vector<common::NamedOutput>{{"-o", options.output}, {"-o", header}});
  target_c::Generated generated;
  try {
    generated =
        target_c::generate(*program, target_options(options), header.substr(header.find_last_of('/') + 1));
  } catch (const common::UserError& error) {
    common::print_message(std::string(error.what()) + "\n");
    return common::kUserError;
  }
  for (const std::string& warning : generated.warnings) common::print_message(warning + "\n");
  for (const auto& [file, text] : {std::pair{options.output, generated.source}, {header, generated.header}}) {
    if (const std::error_code error = common::replace_file(file, text)) {
      common::print_message("apron: error: cannot write '" + file + "': " + error.message() + "\n");
      return common::kFailed;
    }
  }
  common::print_output(report_text(options, generated.report));
  return common::kDone;
}

}  // namespace apron::run
