#include "apron/run/ui/LayoutFile.h"

#include "common/files/UserFile.h"

namespace apron::run {
namespace {

constexpr const char* kName = "apron-window.layout";

}  // namespace

ui::PaneLayout load_layout(bool reset) {
  if (reset) common::remove_user_file(kName);
  return ui::parse_layout(common::read_user_file(kName));
}

void save_layout(const ui::PaneLayout& layout) { common::write_user_file(kName, ui::format_layout(layout)); }

}  // namespace apron::run
