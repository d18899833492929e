// Splits text into lines of tokens: comments removed, continued lines joined. A line with a bad character is
// reported and marked; its tokens before it are kept, so that an `if` in it still has its `endif`.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/SourceManager.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

inline constexpr std::size_t kMaxFileBytes = std::size_t{16} << 20;

std::vector<Line> lex(const SourceManager&, std::uint32_t file, Diagnostics&);

}  // namespace apron::syntax
