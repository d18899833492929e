#include "common/files/NewPart.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"
#include "common/files/PreparedOutputs.h"
#include "common/files/RealPath.h"

namespace common {
namespace fs = std::filesystem;

NewPart::NewPart(const fs::path& name)
    : name_(replaced_path(name)), path_(prepared_part(name_).value_or(part_of(name_))), unfinished_(path_) {
  const auto refuse = [&](const std::string& reason) {
    throw UserError(name.string() + ": cannot be written: " + reason);
  };
  std::error_code error;
  if (const fs::file_status status = fs::status(name, error);
      fs::exists(status) && !fs::is_regular_file(status))
    refuse("it is not a regular file");
  if (const std::error_code refusal = refused_output(name_)) refuse(refusal.message());
  if (const std::string reason = too_long_for_part(name_, path_); !reason.empty()) refuse(reason);
  error.clear();
  fs::remove(path_, error);
  if (error) refuse(error.message());
  file_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC | O_CREAT | O_EXCL | O_NOFOLLOW, part_mode(name_));
  if (file_ < 0) refuse(std::error_code(errno, std::generic_category()).message());
}

NewPart::~NewPart() {
  if (!committed_) discard_part(path_);
  ::close(file_);
}

std::error_code NewPart::commit() {
  struct stat ours {
  }, named{};
  if (::fstat(file_, &ours) != 0 || ::lstat(path_.c_str(), &named) != 0 || ours.st_dev != named.st_dev ||
      ours.st_ino != named.st_ino)
    return lost_part();
  const std::error_code error = rename_part(path_, name_);
  committed_ = !error;
  return error;
}

}  // namespace common
