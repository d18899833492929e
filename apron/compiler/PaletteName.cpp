#include "apron/compiler/PaletteName.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "apron/program/Palette.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

std::string wrong_palette(std::string_view name) {
  if (program::find_palette(name)) return {};
  std::vector<std::string> known = program::palette_names();
  std::string meant = syntax::did_you_mean(name, known);
  known.resize(program::kPalettes);
  if (meant.empty()) meant = fmt::format("; there are {}", fmt::join(known, ", "));
  return fmt::format("there is no palette '{}'{}", name, meant);
}

}  // namespace apron::compiler
