#include "common/files/UserFile.h"

#include <cstdlib>
#include <system_error>

#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"

namespace common {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = 65536;

}  // namespace

fs::path user_file(const std::string& name) {
  const char* const config = std::getenv("XDG_CONFIG_HOME");
  const char* const home = std::getenv("HOME");
  fs::path folder;
  if (config != nullptr && fs::path(config).is_absolute())
    folder = config;
  else if (home != nullptr && fs::path(home).is_absolute())
    folder = fs::path(home) / ".config";
  return folder.empty() ? folder : folder / "smartsurf" / name;
}

std::string read_user_file(const std::string& name) {
  std::string text;
  return read_file(user_file(name), kMaxBytes, text) ? "" : text;
}

void write_user_file(const std::string& name, std::string_view text) {
  const fs::path path = user_file(name);
  if (path.empty()) return;
  std::error_code ignored;
  fs::create_directories(path.parent_path(), ignored);
  ignored = replace_file(path, std::string(text));
}

void remove_user_file(const std::string& name) {
  std::error_code ignored;
  fs::remove(user_file(name), ignored);
}

}  // namespace common
