#include "apron/run/ui/LayoutFile.h"

#include <cstdlib>
#include <filesystem>
#include <string>

#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"

namespace apron::run {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxLayoutBytes = 4096;

// Empty if the environment names no home.
fs::path layout_path() {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  fs::path folder;
  if (config != nullptr && fs::path(config).is_absolute())
    folder = config;
  else if (home != nullptr && fs::path(home).is_absolute())
    folder = fs::path(home) / ".config";
  return folder.empty() ? folder : folder / "smartsurf" / "apron-window.layout";
}

}  // namespace

ui::PaneLayout load_layout(bool reset) {
  const fs::path path = layout_path();
  std::error_code ignored;
  if (reset) fs::remove(path, ignored);
  std::string text;
  if (common::read_file(path, kMaxLayoutBytes, text)) return {};
  return ui::parse_layout(text);
}

void save_layout(const ui::PaneLayout& layout) {
  const fs::path path = layout_path();
  if (path.empty()) return;
  std::error_code ignored;
  fs::create_directories(path.parent_path(), ignored);
  ignored = common::replace_file(path, ui::format_layout(layout));
}

}  // namespace apron::run
