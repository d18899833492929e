// Compiles a program from memory, for the tests.
#pragma once

#include <map>
#include <string>

#include "apron/compiler/Compiler.h"
#include "apron/program/Program.h"
#include "apron/syntax/Diagnostic.h"

namespace apron::compiler {

inline CompileResult compile_text(const std::string& text,
                                  const std::map<std::string, std::string>& files = {}) {
  syntax::MemoryReader reader;
  reader.files = files;
  reader.files["main.aps"] = text;
  CompileOptions options;
  options.file = "main.aps";
  options.width = 8;
  options.height = 6;
  options.library_path = "lib";
  return compile(options, reader);
}

inline std::string errors(const CompileResult& result) {
  return syntax::format_diagnostics(result.diagnostics, result.sources);
}

inline std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

// "op a, b" for each instruction, without numbers and places.
inline std::string listing(const CompileResult& result) {
  if (!result.program) return errors(result);
  std::string text;
  for (std::size_t i = 0; i < result.program->code.size(); ++i) {
    std::string line = program::disassemble(*result.program, i).substr(7);
    line = line.substr(0, line.find(" ; "));
    while (line.back() == ' ') line.pop_back();
    const std::size_t gap = line.find(' ');
    if (gap != std::string::npos)
      line = line.substr(0, gap) + line.substr(line.find_first_not_of(' ', gap) - 1);
    text += line + '\n';
  }
  return text;
}

}  // namespace apron::compiler
