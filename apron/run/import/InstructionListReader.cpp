#include "apron/run/import/InstructionListReader.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

namespace apron::run {

using Kind = KernelTokenKind;

ImportedKernels InstructionListReader::translate(std::string_view text) {
  std::size_t line = 1;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view row = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t first = row.find_first_not_of(" \t\r");
    const bool is_comment = first != std::string_view::npos &&
                            (row[first] == '#' || row[first] == '%' || row.substr(first).starts_with("//"));
    if (is_comment) {
      const std::size_t from = row.find_first_not_of("#%/ \t", first);
      if (from != std::string_view::npos)
        main_.push_back("// " + std::string(row.substr(from, row.find('\r') - from)));
    } else if (first != std::string_view::npos) {
      tokens_ = scan_kernel_source(row, line);
      position_ = 0;
      translate_row();
    }
    ++line;
  }
  return finish();
}

void InstructionListReader::translate_row() {
  const std::size_t line = peek().line;
  try {
    if (peek().kind == Kind::kName && peek(1).is("=") && peek(2).kind == Kind::kName && peek(3).is("(")) {
      const KernelToken target = peek();
      const std::string name = peek(2).text;
      position_ += 3;
      std::vector<KernelTokenList> arguments = parse_arguments();
      arguments.insert(arguments.begin(), KernelTokenList{target});
      call_statement(name, arguments, line, main_, 0);
    } else {
      while (!at_end()) translate_statement();
    }
  } catch (const Untranslatable& error) {
    note(line, error.reason);
    main_.push_back(fmt::format("// not translated (line {}): {}", line, error.reason));
  }
}

void InstructionListReader::translate_statement() {
  if (peek().kind == Kind::kComment) {
    emit_comment(main_, 0);
  } else if (peek().kind == Kind::kName && peek(1).is("(")) {
    translate_call(main_, 0);
  } else if (!consume(";")) {
    give_up("'{}' begins no instruction", peek().text);
  }
}

}  // namespace apron::run
