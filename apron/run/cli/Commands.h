// `apron run`, `check`, `disasm`, `fmt` and `import`. Each prints its result or diagnostics and returns the
// exit status.
#pragma once

#include "apron/run/options/Options.h"

namespace apron::run {

int run_program(const Options& options);
int check_program(const Options& options);
int disassemble_program(const Options& options);
int format_programs(const Options& options);
int import_program(const Options& options);

}  // namespace apron::run
