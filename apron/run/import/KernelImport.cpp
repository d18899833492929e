#include "apron/run/import/KernelImport.h"

#include <algorithm>
#include <utility>

#include "apron/run/import/InstructionListReader.h"
#include "apron/run/import/KernelSourceReader.h"
#include "apron/run/import/KernelTokens.h"

namespace apron::run {

// Reads the patterns of the macros and the declarations, line by line.
KernelVocabulary read_vocabulary(std::string_view library) {
  KernelVocabulary vocabulary;
  vocabulary.names = {"north", "east", "south", "west", "alldir"};
  bool is_pattern = false;
  while (!library.empty()) {
    const std::size_t end = std::min(library.find('\n'), library.size());
    std::string line(library.substr(0, end));
    library.remove_prefix(std::min(end + 1, library.size()));
    const std::size_t open = line.find('(');
    if (is_pattern) {
      const bool has_result = line.starts_with('$');
      if (has_result) line.erase(0, line.find('=') + 2);
      const std::string name = line.substr(0, line.find('('));
      const std::size_t arity = std::ranges::count(line, '$');
      if (has_result && arity == 0) vocabulary.names.insert(name);  // XN, which is read as a register
      (has_result ? vocabulary.values : vocabulary.statements)[name].insert(arity);
    } else if (open != std::string::npos &&
               (line.starts_with("!register(") || line.starts_with("!machine_register("))) {
      std::string name;
      for (const char c : line.substr(open + 1)) {
        if (c != ',' && c != ')' && c != ' ') name += c;
        if (c == ',' || c == ')') vocabulary.names.insert(std::exchange(name, {}));
      }
    } else if (line.starts_with("!define(")) {
      vocabulary.names.insert(line.substr(8, line.find(',') - 8));
    }
    is_pattern = line.starts_with("!macro_def");
  }
  return vocabulary;
}

ImportedKernels import_kernels(std::string_view text, const KernelVocabulary& vocabulary,
                               const ImportOptions& options) {
  const KernelTokenList tokens = scan_kernel_source(text);
  const bool is_list = std::ranges::none_of(
      tokens, [](const KernelToken& token) { return token.is("{") || token.is_name("scamp5_kernel_begin"); });
  return is_list ? InstructionListReader(vocabulary, options).translate(text)
                 : KernelSourceReader(vocabulary, options).translate(text);
}

}  // namespace apron::run
