#include "apron/compiler/PaletteCheck.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "common/color/Palette.h"
#include "common/text/Suggestion.h"

namespace apron::compiler {

std::string palette_error(std::string_view name) {
  if (common::find_palette(name)) return {};
  std::vector<std::string> known = common::palette_names();
  std::string hint = common::did_you_mean(name, known);
  known.resize(common::palette_count());
  if (hint.empty()) hint = fmt::format("; there are {}", fmt::join(known, ", "));
  return fmt::format("there is no palette '{}'{}", name, hint);
}

}  // namespace apron::compiler
