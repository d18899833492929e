// Lists the opcodes and built-in names that no script in SCRIPTS uses.
//
//   apron_example_coverage SCRIPTS LIBRARY
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>
#include <string>

#include "apron/compiler/Builtins.h"
#include "apron/compiler/Compiler.h"

namespace {

namespace fs = std::filesystem;
using namespace apron;

// Only scripts with an expectation count as tests.
bool has_expectation(const fs::path& script) {
  std::ifstream file(script);
  for (std::string line; std::getline(file, line);)
    if (line.find("// expect") != std::string::npos) return true;
  return false;
}

void collect_opcodes(const fs::path& script, const std::string& library, std::set<program::Opcode>& seen) {
  compiler::CompileOptions options;
  options.file = script.string();
  options.width = options.height = 8;
  options.library_path = library;
  syntax::DiskReader reader;
  const compiler::CompileResult result = compiler::compile(options, reader);
  if (!result.program) return;  // the script tests an error
  for (const program::Instruction& instruction : result.program->code) seen.insert(instruction.op);
}

// Collects the words of a script outside comments.
void collect_words(const fs::path& script, std::set<std::string>& words) {
  std::ifstream file(script);
  for (std::string line; std::getline(file, line);) {
    line.resize(std::min(line.find("//"), line.size()));
    std::string word;
    for (const char c : line + " ") {
      const bool inside = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
      if (inside) {
        word += c;
      } else {
        words.insert(word);
        word.clear();
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  std::set<std::string> words;
  std::set<program::Opcode> seen;
  for (const fs::directory_entry& entry : fs::directory_iterator(argv[1]))
    if (entry.path().extension() == ".aps" && has_expectation(entry.path())) {
      collect_opcodes(entry.path(), argv[2], seen);
      collect_words(entry.path(), words);
    }
  int missing = 0;
  for (const std::string& name : compiler::builtin_names()) {
    if (words.count(name) > 0) continue;
    std::cout << "no script in " << argv[1] << " uses the name " << name << '\n';
    ++missing;
  }
  for (std::size_t i = 0; i < program::opcode_count(); ++i) {
    const auto op = static_cast<program::Opcode>(i);
    if (seen.count(op) > 0) continue;
    std::cout << "no script in " << argv[1] << " uses the instruction " << program::opcode_info(op).mnemonic
              << '\n';
    ++missing;
  }
  return missing == 0 ? 0 : 1;
}
