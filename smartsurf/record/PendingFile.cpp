#include "smartsurf/record/PendingFile.h"

#include <system_error>

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

fs::path link_target(const fs::path& name) {
  std::error_code error;
  if (!fs::is_symlink(fs::symlink_status(name, error))) return name;
  const fs::path target = fs::weakly_canonical(name, error);
  return error ? name : target;
}

}  // namespace

PendingFile::PendingFile(const fs::path& name) : final_(link_target(name)), path_(final_) {
  std::error_code error;
  const fs::file_status status = fs::status(final_, error);
  committed_ = fs::exists(status) && !fs::is_regular_file(status);
  if (!committed_) path_ += ".part";
}

PendingFile::~PendingFile() {
  std::error_code error;
  if (owned_ && !committed_) fs::remove(path_, error);
}

void PendingFile::own() {
  if (committed_) return;
  fs::remove(path_);
  owned_ = true;
  unfinished_.emplace(path_);
}

void PendingFile::commit() {
  if (committed_) return;
  fs::rename(path_, final_);
  unfinished_.reset();
  committed_ = true;
}

void PendingFile::commit_if_new() {
  std::error_code error;
  if (!fs::exists(final_, error)) commit();
}

}  // namespace smartsurf::record
