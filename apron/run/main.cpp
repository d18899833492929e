#include <cstdio>
#include <exception>
#include <iostream>

#include "apron/run/cli/Commands.h"
#include "apron/run/cli/Repl.h"
#include "apron/run/options/CompiledProgram.h"
#include "common/error/UserError.h"
#include "common/process/ExitStatus.h"
#include "common/process/StandardStreams.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

int run_subcommand(int argc, char** argv) {
  const ParsedOptions parsed = parse_options(argc, argv);
  if (parsed.exit_status) return *parsed.exit_status;
  switch (parsed.options.subcommand) {
    case Subcommand::kRun:
      load_palettes(parsed.options);
      return run_program(parsed.options);
    case Subcommand::kCheck:
      load_palettes(parsed.options);
      return check_program(parsed.options);
    case Subcommand::kDisassemble:
      load_palettes(parsed.options);
      return disassemble_program(parsed.options);
    case Subcommand::kFormat:
      return format_programs(parsed.options);
    case Subcommand::kImport:
      return import_program(parsed.options);
    case Subcommand::kCompile:
      load_palettes(parsed.options);
      return compile_for_boards(parsed.options);
    case Subcommand::kDebug:
      load_palettes(parsed.options);
      return debug_program(parsed.options);
    case Subcommand::kLanguageServer:
      return serve_editors(parsed.options);
    case Subcommand::kRepl:
      load_palettes(parsed.options);
      return run_repl(parsed.options);
  }
  return common::kFailed;
}

int print_failure(int status, const char* text) noexcept {
  common::print_error_line("apron: error", text);
  return status;
}

// `status`, or kFailed if the output of a run that succeeded is incomplete.
int status_after_output(int status) noexcept {
  if (status != common::kDone) return status;
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return status;
  return print_failure(common::kFailed, "cannot write the output");
}

}  // namespace
}  // namespace apron::run

int main(int argc, char** argv) {
  using namespace apron::run;
  common::open_standard_streams();
  common::report_file_size_errors();
  const common::Termination termination("apron");
  try {
    return status_after_output(run_subcommand(argc, argv));
  } catch (const common::UserError& error) {
    return print_failure(common::kUserError, error.what());
  } catch (const std::exception& error) {
    return print_failure(common::kFailed, common::failure_text(error));
  }
}
