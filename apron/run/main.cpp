#include "apron/run/cli/Commands.h"
#include "apron/run/cli/Repl.h"

int main(int argc, char** argv) {
  using namespace apron::run;
  const ParsedOptions parsed = parse_options(argc, argv);
  if (parsed.exit_status) return *parsed.exit_status;
  switch (parsed.options.subcommand) {
    case Subcommand::kRun:
      return run_program(parsed.options);
    case Subcommand::kCheck:
      return check_program(parsed.options);
    case Subcommand::kDisassemble:
      return disassemble_program(parsed.options);
    case Subcommand::kFormat:
      return format_programs(parsed.options);
    case Subcommand::kImport:
      return import_program(parsed.options);
    case Subcommand::kRepl:
      return run_repl(parsed.options);
  }
  return common::kFailed;
}
