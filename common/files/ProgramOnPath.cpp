#include "common/files/ProgramOnPath.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <system_error>

namespace common {

namespace fs = std::filesystem;

fs::path program_on_path(const std::string& name) {
  const char* const path = std::getenv("PATH");
  const std::string folders = path != nullptr ? path : "/bin:/usr/bin";  // as execvp(3)
  for (std::size_t from = 0; from <= folders.size();) {
    const std::size_t to = std::min(folders.find(':', from), folders.size());
    const fs::path file = fs::path(to == from ? "." : folders.substr(from, to - from)) / name;
    std::error_code error;
    if (fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0) return file;
    from = to + 1;
  }
  return {};
}

}  // namespace common
