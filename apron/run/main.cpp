#include "apron/run/Commands.h"
#include "apron/run/Repl.h"

int main(int argc, char** argv) {
  using namespace apron::run;
  const ParsedOptions parsed = parse_options(argc, argv);
  if (parsed.exit_status) return *parsed.exit_status;
  switch (parsed.options.command) {
    case Command::kRun:
      return run_program(parsed.options);
    case Command::kCheck:
      return check_program(parsed.options);
    case Command::kDisassemble:
      return disassemble_program(parsed.options);
    case Command::kFormat:
      return format_programs(parsed.options);
    case Command::kRepl:
      return run_repl(parsed.options);
  }
  return kRunFailed;
}
