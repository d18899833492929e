// What the lines of a macro or function write, as far as their words show it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "apron/syntax/Token.h"

namespace apron::syntax {

// How a parameter is written; the greater of two holds.
enum class WriteKind : std::uint8_t {
  kNone,
  kUnknown,  // by a macro that is not defined so far, perhaps
  kWhole,
  kElement,  // an element of the array that it is
};

struct BodyWrites {
  // A name or parameter, alone or with an index.
  struct Place {
    Token name;
    bool is_element = false;
  };
  struct Call {
    std::string name;
    std::size_t argument_count = 0;
    bool has_result = false;
    bool begins_with_text = false;
    std::vector<std::pair<std::size_t, Place>> places;  // the arguments that are one, by their number
  };

  std::vector<Place> targets;  // before '='
  std::vector<Place> declared;
  std::vector<Call> calls;
};

BodyWrites find_writes(const std::vector<Line>& body);

// True for `!register`, `!scalar`, `!int32` and the like, which declare a function's local names.
bool declares_locals(const Token& directive);

}  // namespace apron::syntax
