// Splits text into lines of tokens: comments removed, continued lines joined. A line with a bad character is
// reported and marked; its tokens before it are kept, so that an `if` in it still has its `endif`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/SourceManager.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

inline constexpr std::size_t kMaxFileBytes = std::size_t{16} << 20;

// Bytes of the operator, bracket or comma that the text begins with; 0 if there is none.
std::size_t punctuator_length(std::string_view text) noexcept;

std::vector<Line> lex(const SourceManager&, std::uint32_t file, Diagnostics&);

}  // namespace apron::syntax
