#include "common/files/RealPath.h"

#include <system_error>

namespace common {

namespace fs = std::filesystem;

fs::path real_path(const fs::path& path) {
  constexpr int kMaxLinks = 40;  // as Linux
  std::error_code error;
  fs::path real = fs::absolute(path.empty() ? fs::path(".") : path, error);
  for (int links = 0; !error && links < kMaxLinks; ++links) {
    real = fs::weakly_canonical(real, error);  // leaves a link whose target does not exist
    std::error_code absent;
    if (error || !fs::is_symlink(fs::symlink_status(real, absent))) break;
    real = real.parent_path() / fs::read_symlink(real, error);
  }
  return error || fs::is_symlink(fs::symlink_status(real, error)) ? fs::path() : real;
}

}  // namespace common
