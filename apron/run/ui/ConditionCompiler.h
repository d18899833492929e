// Compiles a breakpoint condition typed by the user against a program's symbols (debugger::Condition).
#pragma once

#include <optional>
#include <string>

#include "apron/program/Program.h"

namespace apron::run {

// width, height: the default size of the program's registers. On failure returns nullopt and sets error to
// one line.
std::optional<program::Program> compile_condition(const std::string& condition,
                                                  const program::Program& debuggee, std::uint32_t width,
                                                  std::uint32_t height, std::string& error);

}  // namespace apron::run
