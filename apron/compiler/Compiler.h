// Compiles APRON source to a program that passes program::verify(), or to diagnostics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"
#include "apron/syntax/SourceManager.h"

namespace apron::compiler {

struct CompileOptions {
  std::string file;
  std::uint32_t width = 0, height = 0;     // of the surface, in cells: the default shape of registers
  std::vector<std::string> include_paths;  // for !include, after the including file's directory
  std::string library_path;                // the installed library, searched last; "" for none
  std::string prelude;                     // a file included before the first line; "" for none
};

struct CompileResult {
  std::optional<program::Program> program;  // only without errors
  std::vector<syntax::Diagnostic> diagnostics, warnings;
  syntax::SourceManager sources;  // for syntax::format(diagnostics, sources)
};

// Terminates for every source and never throws because of its contents. Allocates; keeps no state between
// calls.
CompileResult compile(const CompileOptions&, syntax::FileReader&);

}  // namespace apron::compiler
