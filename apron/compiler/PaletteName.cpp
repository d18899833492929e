#include "apron/compiler/PaletteName.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "apron/program/Palette.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

std::string wrong_palette(std::string_view name) {
  if (program::find_palette(name)) return {};
  const std::vector<std::string> known = program::palette_names();
  const std::string meant = syntax::did_you_mean(name, known);
  return fmt::format("there is no palette '{}'{}", name,
                     meant.empty() ? fmt::format("; there are {}", fmt::join(known, ", ")) : meant);
}

}  // namespace apron::compiler
