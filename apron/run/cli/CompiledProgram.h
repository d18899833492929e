// A program file compiled for an array size; diagnostics go to stderr.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Listing.h"
#include "apron/program/Program.h"
#include "apron/run/cli/Options.h"

namespace apron::run {

compiler::CompileOptions compile_options(const Options& options, std::uint32_t width, std::uint32_t height);

struct CompiledProgram {
  program::Program program;
  std::vector<debugger::SourceText> sources;  // the main file first
};
// Without a program, `wrong` has the diagnostics as text.
std::optional<CompiledProgram> compile_with_sources(const Options& options, std::uint32_t width,
                                                    std::uint32_t height, std::string& errors);

std::optional<program::Program> compile_or_report(const Options& options, std::uint32_t width,
                                                  std::uint32_t height);

// Where modules are looked for: beside the program, then in the -I paths, then in the library.
std::vector<std::string> module_search_paths(const Options& options);

}  // namespace apron::run
