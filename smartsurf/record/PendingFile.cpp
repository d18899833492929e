#include "smartsurf/record/PendingFile.h"

#include <sys/stat.h>

#include <stdexcept>
#include <system_error>

#include "common/files/PreparedOutputs.h"
#include "common/files/RealPath.h"

namespace smartsurf::record {
namespace fs = std::filesystem;

PendingFile::PendingFile(const fs::path& name) : final_(common::replaced_path(name)), path_(final_) {
  std::error_code error;
  const fs::file_status status = fs::status(final_, error);
  committed_ = fs::exists(status) && !fs::is_regular_file(status);
  if (!committed_) path_ += ".part";
}

PendingFile::~PendingFile() {
  if (owned_ && !committed_ && !owner_.is_child()) common::discard_part(path_);
}

void PendingFile::own() {
  if (committed_) return;
  must_be_new_ = !common::is_prepared(path_);
  if (must_be_new_) fs::remove(path_);
  owned_ = true;
  unfinished_.emplace(path_);
}

void PendingFile::note_length(off_t length) {
  length_ = length;
  struct stat status {};
  if (!owned_ || inode_ != 0 || ::stat((committed_ ? final_ : path_).c_str(), &status) != 0) return;
  device_ = status.st_dev;
  inode_ = status.st_ino;
}

void PendingFile::require_unchanged() const {
  if (!owned_ || inode_ == 0) return;
  struct stat status {};
  if (::stat((committed_ ? final_ : path_).c_str(), &status) != 0)
    throw std::runtime_error(final_.string() + ": was removed while the run recorded it");
  if (status.st_dev != device_ || status.st_ino != inode_)
    throw std::runtime_error(final_.string() + ": was replaced while the run recorded it");
  if (status.st_size < length_)
    throw std::runtime_error(final_.string() + ": was cut while the run recorded it");
}

void PendingFile::commit() {
  if (committed_) return;
  if (const std::error_code error = common::rename_part(path_, final_))
    throw std::system_error(error, path_.string());
  unfinished_.reset();
  committed_ = true;
}

void PendingFile::commit_if_new() {
  std::error_code error;
  if (!fs::exists(final_, error)) commit();
}

}  // namespace smartsurf::record
