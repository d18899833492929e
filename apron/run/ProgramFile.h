// A program file compiled for an array's size; what is wrong with it is printed on stderr.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Listing.h"
#include "apron/program/Program.h"
#include "apron/run/Options.h"

namespace apron::run {

compiler::CompileOptions compile_options(const Options& options, std::uint32_t width, std::uint32_t height);

struct Compiled {
  program::Program program;
  std::vector<debugger::SourceText> texts;  // the main file first
};
// Without a program, `wrong` has the diagnostics as text.
std::optional<Compiled> compile_texts(const Options& options, std::uint32_t width, std::uint32_t height,
                                      std::string& wrong);

std::optional<program::Program> compile_file(const Options& options, std::uint32_t width,
                                             std::uint32_t height);

// Where modules are looked for: beside the program, then in the -I paths, then in the library.
std::vector<std::string> module_paths(const Options& options);

}  // namespace apron::run
