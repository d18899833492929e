// `apron run`, `check`, `disasm`, `fmt`, `import`, `compile`, `debug` and `lsp`. Each prints its result or
// diagnostics and returns the exit status.
#pragma once

#include "apron/run/options/Options.h"

namespace apron::run {

int run_program(const Options& options);
int check_program(const Options& options);
int disassemble_program(const Options& options);
int format_programs(const Options& options);
int import_program(const Options& options);
int compile_for_boards(const Options& options);
int debug_program(const Options& options);
int serve_editors(const Options& options);

// Throws common::UserError unless every --set names a slider or switch of the program and a value of it.
void check_parameters(const Options& options, const program::Program& program);
// The cameras, clocks, keys and folders of the options.
HostEnvironment host_environment(const Options& options);

}  // namespace apron::run
