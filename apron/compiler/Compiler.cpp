#include "apron/compiler/Compiler.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Builtins.h"
#include "apron/compiler/DefiniteAssignment.h"
#include "apron/compiler/Lowering.h"
#include "apron/compiler/PaletteCheck.h"
#include "apron/program/BoundaryFlow.h"
#include "apron/syntax/Parser.h"
#include "apron/syntax/Preprocessor.h"

namespace apron::compiler {
namespace {

void check_definite_assignment(const program::Program& program, const Lowering& lowering,
                               syntax::Diagnostics& diagnostics) {
  for (const ScalarRead& read : find_unassigned_reads(program, lowering.scalar_reads())) {
    diagnostics.error(read.location,
                      fmt::format("the scalar '{}' is read here, but nothing can have written it before",
                                  program.variables[read.variable].name));
  }
}

syntax::Location location_of(const program::Program& program, std::size_t instruction,
                             const syntax::SourceManager& sources) {
  const program::SourceLocation* at = program::find_location(program, instruction);
  for (std::uint32_t file = 0; at && file < sources.file_count(); ++file)
    if (sources.file(file).name == program.files[at->file])
      return {file, at->line, at->column, at->expansion};
  return {};
}

// Numbers that meet registers of integers beyond the edge, as Lowering::check_cell_values() those that meet
// them elsewhere.
void check_boundaries(const program::Program& program, const syntax::SourceManager& sources,
                      syntax::Diagnostics& diagnostics) {
  for (const program::BoundaryMismatch& found : program::find_boundary_mismatches(program))
    diagnostics.error(location_of(program, found.instruction, sources),
                      fmt::format("{}, the boundary's value, is no {}, the type of the registers that it "
                                  "meets: a whole number from {} to {}",
                                  found.value, program::cell_type_name(found.type),
                                  program::lowest_cell(found.type), program::highest_cell(found.type)));
}

// Checks that need the whole program.
void check_program(const program::Program& program, std::size_t max_addr,
                   const syntax::SourceManager& sources, syntax::Diagnostics& diagnostics) {
  if (program.code.size() > max_addr) {
    diagnostics.error({}, fmt::format("the program has {} instructions, and '!max_addr' allows {}",
                                      program.code.size(), max_addr));
  } else if (const std::string error = program::verify(program); !error.empty()) {
    diagnostics.error({}, error);
  } else {
    check_boundaries(program, sources, diagnostics);
  }
}

// The line of the main file that leads to the location.
std::uint32_t main_line(syntax::Location at, const syntax::SourceManager& sources) {
  while (at.expansion != 0 || at.file != 0)
    at = at.expansion != 0 ? sources.expansion(at.expansion).call : sources.file(at.file).included_from;
  return at.line;
}

void insert(const Mark& mark, const syntax::SourceManager& sources,
            std::vector<syntax::Statement>& statements) {
  syntax::Statement print;
  print.kind = syntax::StatementKind::kCall;
  print.location = {0, mark.line, 1, 0};
  print.value.kind = syntax::ExpressionKind::kCall;
  print.value.text = "print";
  print.value.children.resize(1);
  print.value.children[0].kind = syntax::ExpressionKind::kString;
  print.value.children[0].text = mark.text;
  const auto behind = std::ranges::find_if(statements, [&](const syntax::Statement& statement) {
    return main_line(statement.location, sources) >= mark.line;
  });
  statements.insert(behind, std::move(print));
}

std::optional<program::Program> compile_program(const CompileOptions& options, syntax::FileReader& reader,
                                                const Mark& mark, syntax::SourceManager& sources,
                                                syntax::Diagnostics& diagnostics) {
  syntax::Preprocessor preprocessor(preprocessing(options), reader, sources, diagnostics);
  std::vector<syntax::Statement> statements = syntax::Parser(preprocessor, sources, diagnostics).parse();
  if (preprocessor.is_aborted()) return std::nullopt;
  if (mark.line != 0) insert(mark, sources, statements);
  Lowering lowering({options.width, options.height}, sources, diagnostics, preprocessor);
  for (const syntax::Preprocessor::NamedModule& module : preprocessor.modules())
    lowering.add_module(module.name, module.location);
  lowering.lower_program(statements);
  program::Program program = lowering.finish();
  if (diagnostics.empty()) check_definite_assignment(program, lowering, diagnostics);
  if (diagnostics.empty()) check_program(program, preprocessor.max_addr(), sources, diagnostics);
  if (!diagnostics.empty()) return std::nullopt;
  return program;
}

}  // namespace

syntax::PreprocessorOptions preprocessing(const CompileOptions& options) {
  syntax::PreprocessorOptions result{options};
  result.is_builtin = [](std::string_view name) { return find_builtin(name) != nullptr; };
  result.written_argument = [](std::string_view name, std::size_t arguments) {
    const Builtin* builtin = find_builtin(name);
    return builtin == nullptr ? -1 : builtin->written_argument(arguments);
  };
  result.check_palette = palette_error;
  return result;
}

CompileResult compile(const CompileOptions& options, syntax::FileReader& reader, const Mark& mark) {
  CompileResult result;
  syntax::Diagnostics diagnostics;
  result.program = compile_program(options, reader, mark, result.sources, diagnostics);
  result.diagnostics = diagnostics.take();
  result.warnings = diagnostics.take_warnings();
  return result;
}

}  // namespace apron::compiler
