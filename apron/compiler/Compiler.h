// Compiles APRON source to a program that passes program::verify(), or to diagnostics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/SourceManager.h"

namespace apron::compiler {

using CompileOptions = syntax::SourceOptions;

struct CompileResult {
  std::optional<program::Program> program;  // only without errors
  std::vector<syntax::Diagnostic> diagnostics, warnings;
  syntax::SourceManager sources;  // for syntax::format(diagnostics, sources)
};

// A print(text) that is no line of the program: before all that the main file has from the line on, in its
// macros and includes, too.
struct Mark {
  std::uint32_t line = 0;  // from 1; 0: none
  std::string text;
};

// The language's instructions, for the preprocessor.
syntax::PreprocessorOptions preprocessing(const CompileOptions&);

// Terminates for every source and never throws because of its contents. Allocates; keeps no state between
// calls.
CompileResult compile(const CompileOptions&, syntax::FileReader&, const Mark& = {});

}  // namespace apron::compiler
