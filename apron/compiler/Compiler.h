// Compiles APRON source to a program that passes program::verify(), or to diagnostics.
#pragma once

#include <optional>
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

// The language's instructions, for the preprocessor.
syntax::PreprocessorOptions preprocessing(const CompileOptions&);

// Terminates for every source and never throws because of its contents. Allocates; keeps no state between
// calls.
CompileResult compile(const CompileOptions&, syntax::FileReader&);

}  // namespace apron::compiler
