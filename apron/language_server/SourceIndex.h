// The names of a program: where each is declared and used. Made from its tokens alone, so that it also holds
// for a program with errors.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apron/syntax/SourceManager.h"
#include "apron/syntax/Token.h"

namespace apron::language_server {

struct Symbol {
  enum class Kind : std::uint8_t {
    kRegister,
    kScalar,
    kMacro,
    kFunction,
    kLabel,
    kDefine,
    kParameter,
    kFilter,
    kClass
  };
  Kind kind = Kind::kScalar;
  std::string name;
  syntax::Location location;  // of the name where it is declared
  std::string text;           // the declaration's line, of a macro its signature
  std::string comment;        // the lines of comment above it
  bool is_counter = false;    // of `!for`
  std::uint32_t scope = 0;    // 0: the program; else the number of a macro's or function's body
};

struct Occurrence {
  syntax::Location location;  // of the first character that renaming replaces
  std::uint32_t length = 0;   // characters
  std::size_t symbol = 0;
};

class SourceIndex {
 public:
  SourceIndex() = default;
  // The files must be lexed as the compiler does; a file that is included twice is indexed once.
  explicit SourceIndex(const syntax::SourceManager&);

  const std::vector<Symbol>& symbols() const noexcept { return symbols_; }
  const std::vector<Occurrence>& occurrences() const noexcept { return occurrences_; }
  // The occurrence at a position: a column is a number of characters, from 1. Nullptr if there is none.
  const Occurrence* find(std::uint32_t file, std::uint32_t line, std::uint32_t column) const;
  // The `a ## b` that may make the name, or another name of the program from it, if the symbol has it or gets
  // it: renaming the symbol changes other names than its own. Nullptr if there is none.
  const syntax::Location* find_join(const Symbol&, const std::string& name) const;
  // The name at a position, also of an instruction; "" if there is none. `start` is its first column.
  std::string name_at(std::uint32_t file, std::uint32_t line, std::uint32_t column,
                      std::uint32_t& start) const;

 private:
  class Builder;

  struct Word {
    syntax::Location location;
    std::uint32_t length = 0;
    std::string name;
  };
  // a ## b ## c, of whose parts a macro's parameters stand for a word of the program and counters for a
  // number.
  struct Join {
    enum class Kind : std::uint8_t { kText, kWord, kNumber };
    struct Part {
      Kind kind = Kind::kText;
      std::string text;
    };
    syntax::Location location;
    std::vector<Part> parts;
  };
  bool can_make(const Join&, std::size_t first_part, std::string_view name) const;

  std::vector<Join> joins_;
  std::set<std::string, std::less<>> texts_;  // of all words
  std::vector<Symbol> symbols_;
  std::vector<Occurrence> occurrences_;
  std::vector<Word> words_;
};

// Characters of a UTF-8 text.
std::uint32_t character_count(std::string_view text);

}  // namespace apron::language_server
