#include "apron/run/host/FileAccess.h"

#include <algorithm>

#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "common/files/Inputs.h"
#include "common/files/RealPath.h"

namespace apron::run {
namespace {

namespace fs = std::filesystem;

bool is_within(const fs::path& path, const fs::path& folder) {
  return std::ranges::mismatch(folder, path).in1 == folder.end();
}

}  // namespace

void FileAccess::require_readable(const std::string& file) const {
  if (common::withhold_output(file)) throw_refused(file, "is an output of this command");
  if (!folders_) return;
  std::error_code error;
  const fs::path real = common::real_path(file, error);
  if (common::leads_nowhere(error)) throw_refused(file, "cannot be found: " + error.message());
  const bool allowed = !real.empty() && std::ranges::any_of(*folders_, [&](const std::string& folder) {
    const fs::path real_folder = common::real_path(folder);
    return !real_folder.empty() && is_within(real, real_folder);
  });
  if (allowed) return;
  fs::path folder = fs::path(file).parent_path();
  if (folder.empty()) folder = ".";
  // Through a link the file lies in another folder than its name says.
  if (!real.empty() && common::real_path(folder) != real.parent_path()) folder = real.parent_path();
  throw_refused(file, "is outside the program's folder; --allow " + folder.string() +
                          " on the command line permits it");
}

void FileAccess::require_writable(const std::string& file) const {
  require_readable(file);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (folders_ && fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status))
    throw_refused(file, "is not a regular file");
  if (common::is_input(file)) throw_refused(file, "is a source of the program, and is not overwritten");
}

}  // namespace apron::run
