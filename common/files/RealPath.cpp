#include "common/files/RealPath.h"

#include <system_error>

namespace common {

namespace fs = std::filesystem;

fs::path real_path(const fs::path& path, std::error_code& error) {
  constexpr int kMaxLinks = 40;  // as Linux
  error.clear();
  fs::path real = fs::absolute(path.empty() ? fs::path(".") : path, error);
  for (int links = 0; !error && links < kMaxLinks; ++links) {
    real = fs::weakly_canonical(real, error);  // leaves a link whose target does not exist
    std::error_code absent;
    if (error || !fs::is_symlink(fs::symlink_status(real, absent))) break;
    real = real.parent_path() / fs::read_symlink(real, error);
  }
  std::error_code absent;
  if (!error && fs::is_symlink(fs::symlink_status(real, absent)))
    error = std::make_error_code(std::errc::too_many_symbolic_link_levels);
  return error ? fs::path() : real;
}

fs::path replaced_path(const fs::path& name) {
  std::error_code error;
  if (!fs::is_symlink(fs::symlink_status(name, error))) return name;
  const fs::path target = real_path(name);
  return target.empty() ? name : target;
}

bool leads_nowhere(const std::error_code& error) noexcept {
  return error == std::errc::filename_too_long || error == std::errc::too_many_symbolic_link_levels ||
         error == std::errc::not_a_directory;
}

fs::path real_path(const fs::path& path) {
  std::error_code error;
  return real_path(path, error);
}

}  // namespace common
