#include "apron/ui/PaneLayout.h"

#include <cmath>
#include <sstream>

namespace apron::ui {
namespace {

constexpr float kMaxPoints = 10'000.0F;

// Calls visit(name, size) for every size of the layout.
template <typename Layout, typename Visitor>
void for_each_size(Layout& layout, Visitor visit) {
  for (const bool wide : {true, false}) {
    auto& sizes = wide ? layout.wide : layout.narrow;
    const std::string prefix = wide ? "wide." : "narrow.";
    visit(prefix + "registers", sizes.registers);
    visit(prefix + "program", sizes.program);
    visit(prefix + "bottom", sizes.bottom);
    visit(prefix + "values", sizes.values);
  }
}

}  // namespace

std::string format_layout(const PaneLayout& layout) {
  std::ostringstream text;
  for_each_size(layout, [&](const std::string& name, float size) {
    if (size > 0.0F) text << name << ' ' << std::lround(size) << '\n';
  });
  return text.str();
}

PaneLayout parse_layout(std::string_view text) {
  PaneLayout layout;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string known;
    float points = 0.0F;
    if (!(words >> known >> points) || !(points >= 0.0F && points <= kMaxPoints)) continue;
    for_each_size(layout, [&](const std::string& name, float& size) {
      if (name == known) size = points;
    });
  }
  return layout;
}

}  // namespace apron::ui
