#include "apron/run/options/CompiledProgram.h"

#include <filesystem>

#include "apron/compiler/BodyCheck.h"
#include "apron/compiler/Compiler.h"
#include "apron/program/Reachability.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"
#include "common/color/PaletteFile.h"
#include "common/error/UserError.h"
#include "common/files/FileKind.h"
#include "common/files/Installation.h"
#include "common/files/ReadFile.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

void append_messages(const std::vector<syntax::Diagnostic>& diagnostics, const syntax::SourceManager& sources,
                     CompilerMessages& messages) {
  messages.text += syntax::format_diagnostics(diagnostics, sources);
  for (const syntax::Diagnostic& diagnostic : diagnostics) {
    const syntax::Location& at = diagnostic.location;
    const std::string file = at.file < sources.file_count() ? sources.file(at.file).name : "";
    messages.entries.push_back({file, at.line, at.column, diagnostic.message, diagnostic.is_warning});
  }
}

}  // namespace

std::string library_path() { return common::installed_file("apron").string(); }

compiler::CompileOptions compile_options(const Options& options, std::uint32_t width, std::uint32_t height) {
  compiler::CompileOptions result;
  result.file = options.program;
  result.width = width;
  result.height = height;
  result.include_paths = options.include_paths;
  result.library_path = library_path();
  if (!options.original.empty()) result.prelude = options.original + ".aps";
  return result;
}

void load_palettes(const Options& options) {
  std::filesystem::path path = options.palettes;
  if (path.empty()) {
    std::error_code error;
    path = std::filesystem::path(options.program).parent_path() / "palettes.txt";
    if (options.program.empty() || !std::filesystem::exists(path, error)) return;
  }
  std::string text;
  if (const std::error_code error = common::read_file(path, common::kMaxTextBytes, text))
    throw common::UserError(path.string() + ": cannot be read: " + error.message());
  common::add_palettes(common::parse_palettes(text, path.string()));
}

// Refuses files that the parser would report line by line.
void refuse_other_kinds(const std::string& file) {
  std::string text;
  if (common::read_file(file, common::kMaxTextBytes, text)) return;
  const common::FileKind kind = common::file_kind(file, text);
  if (kind == common::FileKind::kRecording)
    throw common::UserError(file + ": is a recording, not a program: smartsurf info " + file +
                            " describes it");
  if (kind == common::FileKind::kExperiment)
    throw common::UserError(file + ": is an experiment, not a program: smartsurf run " + file + " runs it");
  if (kind != common::FileKind::kProgram && kind != common::FileKind::kOther)
    throw common::UserError(file + ": is " + std::string(common::description(kind)) + ", not a program");
}

std::optional<CompiledProgram> compile_with_sources(const Options& options, std::uint32_t width,
                                                    std::uint32_t height, CompilerMessages& messages) {
  if (!options.program.empty()) refuse_other_kinds(options.program);
  syntax::DiskReader reader(options.program);
  compiler::CompileOptions compiler_options = compile_options(options, width, height);
  compiler::CompileResult result = compiler::compile(compiler_options, reader);
  if (!options.original.empty() && result.program &&
      !program::can_reach(*result.program, program::Opcode::kSurfaceStep)) {
    compiler_options.prelude = options.original + "-frames.aps";
    result = compiler::compile(compiler_options, reader);
  }
  messages = {};
  append_messages(result.warnings, result.sources, messages);
  if (!result.program) {
    append_messages(result.diagnostics, result.sources, messages);
    return std::nullopt;
  }
  CompiledProgram compiled{std::move(*result.program), {}};
  for (std::uint32_t i = 0; i < result.sources.file_count(); ++i) {
    const syntax::SourceFile& file = result.sources.file(i);
    debugger::SourceText source{file.name, file.text, std::nullopt, file.included_from.line};
    if (file.included_from.line > 0) source.included_in = file.included_from.file;
    compiled.sources.push_back(std::move(source));
  }
  return compiled;
}

std::optional<program::Program> compile_or_report(const Options& options, std::uint32_t width,
                                                  std::uint32_t height) {
  CompilerMessages messages;
  std::optional<CompiledProgram> compiled = compile_with_sources(options, width, height, messages);
  common::print_message(messages.text);
  if (!compiled) return std::nullopt;
  return std::move(compiled->program);
}

std::string body_errors(const Options& options) {
  syntax::DiskReader reader;
  const compiler::CompileResult result =
      compiler::check_macro_bodies(compile_options(options, options.width, options.height), reader);
  return syntax::format_diagnostics(result.diagnostics, result.sources);
}

std::string find_library_file(const std::string& name) {
  std::error_code error;
  if (std::filesystem::exists(name, error) || name.find('/') != std::string::npos) return name;
  const std::filesystem::path installed = std::filesystem::path(library_path()) / name;
  return std::filesystem::exists(installed, error) ? installed.string() : name;
}

std::vector<std::string> module_search_paths(const Options& options) {
  std::vector<std::string> paths{std::filesystem::path(options.program).parent_path().string()};
  paths.insert(paths.end(), options.include_paths.begin(), options.include_paths.end());
  paths.push_back(library_path());
  return paths;
}

}  // namespace apron::run
