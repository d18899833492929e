// Compiles a program file for an array size.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Listing.h"
#include "apron/program/Program.h"
#include "apron/run/options/Options.h"

namespace apron::run {

// The library installed with the executable (../share/smartsurf/apron), or else the source tree's.
std::string library_path();

compiler::CompileOptions compile_options(const Options& options, std::uint32_t width, std::uint32_t height);

struct CompiledProgram {
  program::Program program;
  std::vector<debugger::SourceText> sources;  // the main file first
};
// The compiler's messages: the warnings and, if there is no program, the errors.
struct CompilerMessages {
  std::string text;                                 // as for a terminal
  std::vector<debugger::SourceDiagnostic> entries;  // in the order of the text
};
// Replaces `messages`.
std::optional<CompiledProgram> compile_with_sources(const Options& options, std::uint32_t width,
                                                    std::uint32_t height, CompilerMessages& messages);

// Adds the custom palettes of --palettes, or of palettes.txt beside the program. Call it once, before
// compiling. Throws common::UserError.
void load_palettes(const Options& options);

// Compiles as compile_with_sources() does, and prints the messages to stderr.
std::optional<program::Program> compile_or_report(const Options& options, std::uint32_t width,
                                                  std::uint32_t height);

// The errors in bodies of macros that the program does not use, as for a terminal; "" without any.
std::string body_errors(const Options& options);

// A file as given or, if there is none and the name has no folder, the one of that name in the library.
std::string find_library_file(const std::string& name);

// The directories searched for modules, in order: the program's own, the -I paths, the library.
std::vector<std::string> module_search_paths(const Options& options);

}  // namespace apron::run
