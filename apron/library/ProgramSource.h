// A program's source, from a file or a text, and its compilation for an array size.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"

namespace apron::library {

struct ProgramSource {
  std::string file;                 // its name in messages; includes are searched beside it first
  std::optional<std::string> text;  // nullopt: the file's
  std::vector<std::string> include_paths = {};
  std::string library_path = {};  // the folder of the library's .aps files
  std::string original = {};      // of APRON 2.9: "original" or "scamp5c", the file that is included first
};

struct SizedProgram {
  program::Program program;
  std::string warnings;  // lines, as for a terminal
};

// width, height: the default size of registers. Throws common::UserError with the compiler's messages:
// "file:line:column: error: …", the line and a caret, for each error. Reads files; otherwise keeps no state.
SizedProgram compile(const ProgramSource&, std::uint32_t width, std::uint32_t height);

// Throws common::UserError for a program with native modules, with the place that names the first.
void require_no_modules(const program::Program&);

// The values of sliders and switches, by name.
using ParameterValues = std::vector<std::pair<std::string, float>>;
// Throws common::UserError, one line, unless the program declares all of them, with these values.
void require_parameters(const program::Program&, const ParameterValues&, const std::string& file);

}  // namespace apron::library
