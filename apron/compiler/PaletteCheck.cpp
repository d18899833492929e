#include "apron/compiler/PaletteCheck.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "apron/program/PaletteId.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

std::string palette_error(std::string_view name) {
  if (program::find_palette(name)) return {};
  std::vector<std::string> known = program::palette_names();
  std::string hint = syntax::did_you_mean(name, known);
  known.resize(program::kPaletteCount);
  if (hint.empty()) hint = fmt::format("; there are {}", fmt::join(known, ", "));
  return fmt::format("there is no palette '{}'{}", name, hint);
}

}  // namespace apron::compiler
