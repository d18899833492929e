#include "apron/run/ProgramFile.h"

#include <filesystem>
#include <iostream>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"

namespace apron::run {
namespace {

// The library beside the installed executable (../share/smartsurf/apron), else the source tree's.
std::string library_path() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path installed = self.parent_path().parent_path() / "share" / "smartsurf" / "apron";
  if (!error && std::filesystem::is_directory(installed, error)) return installed.string();
  return APRON_SOURCE_LIBRARY;
}

}  // namespace

compiler::CompileOptions compile_options(const Options& options, std::uint32_t width, std::uint32_t height) {
  compiler::CompileOptions how;
  how.file = options.program;
  how.width = width;
  how.height = height;
  how.include_paths = options.include_paths;
  how.library_path = library_path();
  return how;
}

std::optional<Compiled> compile_texts(const Options& options, std::uint32_t width, std::uint32_t height,
                                      std::string& wrong) {
  syntax::DiskReader reader;
  compiler::CompileResult result = compiler::compile(compile_options(options, width, height), reader);
  if (!result.program) {
    wrong = syntax::format_diagnostics(result.diagnostics, result.sources);
    return std::nullopt;
  }
  Compiled compiled{std::move(*result.program), {}};
  for (std::uint32_t i = 0; i < result.sources.file_count(); ++i) {
    const syntax::SourceFile& file = result.sources.file(i);
    debugger::SourceText text{file.name, file.text, std::nullopt, file.included_from.line};
    if (file.included_from.line > 0) text.included_in = file.included_from.file;
    compiled.texts.push_back(std::move(text));
  }
  return compiled;
}

std::optional<program::Program> compile_file(const Options& options, std::uint32_t width,
                                             std::uint32_t height) {
  std::string wrong;
  std::optional<Compiled> compiled = compile_texts(options, width, height, wrong);
  std::cerr << wrong;
  if (!compiled) return std::nullopt;
  return std::move(compiled->program);
}

std::vector<std::string> module_paths(const Options& options) {
  std::vector<std::string> paths{std::filesystem::path(options.program).parent_path().string()};
  paths.insert(paths.end(), options.include_paths.begin(), options.include_paths.end());
  paths.push_back(library_path());
  return paths;
}

}  // namespace apron::run
