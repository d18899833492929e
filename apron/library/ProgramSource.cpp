#include "apron/library/ProgramSource.h"

#include "apron/compiler/Compiler.h"
#include "apron/program/CallSite.h"
#include "apron/program/Reachability.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"
#include "common/arithmetic/StandardArithmetic.h"
#include "common/error/UserError.h"

namespace apron::library {
namespace {

// Reads the program from its text, if it has one, and all other files from the disk.
class SourceReader final : public syntax::FileReader {
 public:
  explicit SourceReader(const ProgramSource& source) : source_(source), disk_(source.file) {}
  std::optional<std::string> read(const std::string& path) override {
    return source_.text && path == source_.file ? source_.text : disk_.read(path);
  }

 private:
  const ProgramSource& source_;
  syntax::DiskReader disk_;
};

std::string without_last_newline(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

}  // namespace

SizedProgram compile(const ProgramSource& source, std::uint32_t width, std::uint32_t height) {
  const common::StandardArithmetic arithmetic;
  SourceReader reader(source);
  compiler::CompileOptions options;
  options.file = source.file;
  options.width = width;
  options.height = height;
  options.include_paths = source.include_paths;
  options.library_path = source.library_path;
  if (!source.original.empty()) options.prelude = source.original + ".aps";
  compiler::CompileResult result = compiler::compile(options, reader);
  if (!source.original.empty() && result.program &&
      !program::can_reach(*result.program, program::Opcode::kSurfaceStep)) {
    options.prelude = source.original + "-frames.aps";
    result = compiler::compile(options, reader);
  }
  if (!result.program)
    throw common::UserError(
        without_last_newline(syntax::format_diagnostics(result.diagnostics, result.sources)));
  return {std::move(*result.program), syntax::format_diagnostics(result.warnings, result.sources)};
}

void require_no_modules(const program::Program& program) {
  if (program.modules.empty()) return;
  throw common::UserError(program::format_call_site(program, program.modules.front().location) +
                          "error: !module('" + program.modules.front().name +
                          "'): native modules are not loaded here: use apron run --module");
}

void require_parameters(const program::Program& program, const ParameterValues& values,
                        const std::string& file) {
  for (const auto& [name, value] : values)
    if (const std::string problem = program::parameter_problem(program, name, value); !problem.empty())
      throw common::UserError(file + ": " + problem);
}

}  // namespace apron::library
