#include "common/files/Inputs.h"

#include <sys/stat.h>

#include <exception>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <tuple>

#include "common/error/UserError.h"
#include "common/files/RealPath.h"

namespace common {
namespace {

namespace fs = std::filesystem;

// Device, inode and "", or, of a file that does not exist, those of its folder and its name.
using FileIdentity = std::tuple<dev_t, ino_t, std::string>;

std::mutex mutex;
std::set<FileIdentity> inputs, outputs_of_command, withheld_outputs;  // guarded by `mutex`
bool ended = false;                                                   // likewise

class Withheld final : public std::error_category {
 public:
  const char* name() const noexcept override { return "withheld output"; }
  std::string message(int) const override { return "the script or program reads or writes it itself"; }
};

void remember(const struct stat& status) noexcept {
  if (!S_ISREG(status.st_mode)) return;
  try {
    const std::lock_guard lock(mutex);
    if (!ended) inputs.emplace(status.st_dev, status.st_ino, "");
  } catch (const std::bad_alloc&) {
  }
}

// A dangling link stands for the file that it names. False for a pipe or a device, and where there is no such
// folder.
bool identify(const fs::path& file, FileIdentity& identity) {
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0) {
    identity = {status.st_dev, status.st_ino, ""};
    return S_ISREG(status.st_mode);
  }
  fs::path target = real_path(file);
  if (target.empty()) target = file;
  const fs::path folder = target.parent_path();
  if (::stat(folder.empty() ? "." : folder.c_str(), &status) != 0) return false;
  identity = {status.st_dev, status.st_ino, target.filename().string()};
  return true;
}

}  // namespace

void note_input(int descriptor) noexcept {
  struct stat status {};
  if (::fstat(descriptor, &status) == 0) remember(status);
}

void note_input(const fs::path& path) noexcept {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) remember(status);
}

void end_of_inputs() noexcept {
  const std::lock_guard lock(mutex);
  ended = true;
}

bool is_input(const fs::path& path) noexcept {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return false;
  try {
    const std::lock_guard lock(mutex);
    return inputs.contains({status.st_dev, status.st_ino, ""});
  } catch (const std::bad_alloc&) {
    return true;
  }
}

void require_separate_outputs(std::span<const NamedOutput> outputs) {
  std::map<FileIdentity, const NamedOutput*> seen;
  for (const NamedOutput& output : outputs) {
    const std::string name = output.flag + " " + output.file.string();
    if (is_input(output.file))
      throw UserError(name + ": would overwrite an input of this command; choose another name");
    FileIdentity identity;
    if (!identify(output.file, identity)) continue;
    const auto [other, is_new] = seen.emplace(identity, &output);
    if (!is_new)
      throw UserError(name + ": is the same file as " + other->second->flag + " " +
                      other->second->file.string() + "; choose another name");
  }
  const std::lock_guard lock(mutex);
  for (const auto& [identity, output] : seen) outputs_of_command.insert(identity);
}

bool withhold_output(const fs::path& path) noexcept {
  try {
    FileIdentity identity;
    if (!identify(path, identity)) return false;
    const std::lock_guard lock(mutex);
    if (!outputs_of_command.contains(identity)) return false;
    withheld_outputs.insert(identity);
  } catch (const std::exception&) {  // no memory
  }
  return true;
}

std::error_code withheld(const fs::path& path) noexcept {
  static const Withheld category;
  try {
    FileIdentity identity;
    if (!identify(path, identity)) return {};
    const std::lock_guard lock(mutex);
    if (!withheld_outputs.contains(identity)) return {};
  } catch (const std::exception&) {  // no memory
  }
  return {1, category};
}

}  // namespace common
