#include "apron/ui/PaneLayout.h"

#include "common/text/SizeList.h"

namespace apron::ui {
namespace {

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
  return common::format_size_list([&](const auto& visit) { for_each_size(layout, visit); });
}

PaneLayout parse_layout(std::string_view text) {
  PaneLayout layout;
  common::parse_size_list(text, [&](const auto& visit) { for_each_size(layout, visit); });
  return layout;
}

}  // namespace apron::ui
