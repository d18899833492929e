#include "common/files/PreparedOutputs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <string>
#include <utility>

#include "common/error/UserError.h"
#include "common/files/Inputs.h"
#include "common/files/RealPath.h"

namespace common {
namespace {

namespace fs = std::filesystem;

class LostPart final : public std::error_category {
 public:
  const char* name() const noexcept override { return "lost part"; }
  std::string message(int) const override { return "its .part file was removed or replaced meanwhile"; }
};

std::vector<PreparedOutput> outputs;
PreparedOutputKeeper keeper;

std::size_t find(const fs::path& part) noexcept {
  return std::ranges::find(outputs, part, &PreparedOutput::part) - outputs.begin();
}

// A file that this user's process has left, and not a link that leads elsewhere.
bool is_own_file(const fs::path& path) noexcept {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_nlink == 1 &&
         status.st_uid == ::geteuid();
}

constexpr mode_t kPermissions = 0777;

// The permissions of the file of that name; nullopt: there is none.
std::optional<mode_t> file_mode(const fs::path& name) noexcept {
  struct stat status {};
  if (::lstat(name.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return status.st_mode & kPermissions;
}

// Restores the rights that the umask took from part_mode(). A confined process may not: there the part stays
// narrower.
void keep_mode(const fs::path& part, const fs::path& name) noexcept {
  const std::optional<mode_t> wanted = file_mode(name);
  if (wanted && wanted != file_mode(part)) (void)::chmod(part.c_str(), *wanted);
}

}  // namespace

std::error_code refused_output(const fs::path& name) noexcept {
  if (!file_mode(name) || ::faccessat(AT_FDCWD, name.c_str(), W_OK, AT_EACCESS) == 0) return {};
  return {errno, std::generic_category()};
}

unsigned part_mode(const fs::path& name) noexcept { return file_mode(name).value_or(0666); }

std::string too_long_for_part(const fs::path& name, const fs::path& part) {
  constexpr std::size_t kLongest = 255;
  const std::size_t bytes = name.filename().native().size();
  const std::string ending =
      part.filename().native().substr(std::min(bytes, part.filename().native().size()));
  if (bytes > kLongest || bytes + ending.size() <= kLongest) return "";
  return "the name must be " + std::to_string(bytes + ending.size() - kLongest) +
         " bytes shorter, because it ends in '" + ending + "' until it is complete";
}

PreparedOutput prepare_output(const std::string& subject, const fs::path& name, const fs::path& part) {
  PreparedOutput output{.subject = subject, .name = name, .part = part};
  const auto refuse = [&](const std::error_code& reason) {
    throw UserError(subject + ": cannot be written: " + reason.message());
  };
  if (const std::error_code refusal = refused_output(name)) refuse(refusal);
  if (const std::string reason = too_long_for_part(name, part); !reason.empty())
    throw UserError(subject + ": cannot be written: " + reason);
  std::error_code error;
  if (const fs::file_status status = fs::symlink_status(name, error);
      fs::exists(status) && !fs::is_regular_file(status)) {
    output.in_place = true;
    output.part = real_path(name);
    if (output.part.empty()) output.part = name;
    if (fs::exists(output.part, error)) return output;
  }
  output.is_new = true;
  return output;
}

std::error_code create_part(PreparedOutput& output) noexcept {
  if (output.subject.empty() || !std::exchange(output.is_new, false)) return {};
  if (!output.in_place && is_own_file(output.part)) return {};
  std::error_code error;
  if (!output.in_place) fs::remove(output.part, error);
  if (error) return error;
  const int file =
      ::open(output.part.c_str(), O_WRONLY | O_CLOEXEC | O_CREAT | O_EXCL, part_mode(output.name));
  if (file < 0) return {errno, std::generic_category()};
  ::close(file);
  output.is_new = true;
  return {};
}

std::error_code name_part(const PreparedOutput& output) noexcept {
  if (!output.in_place) keep_mode(output.part, output.name);
  if (output.in_place || ::rename(output.part.c_str(), output.name.c_str()) == 0) return {};
  return {errno, std::generic_category()};
}

void remove_part(const PreparedOutput& output) noexcept {
  struct stat status {};
  if (!output.in_place)
    ::unlink(output.part.c_str());
  else if (output.is_new && ::lstat(output.part.c_str(), &status) == 0 && status.st_size == 0)
    ::unlink(output.part.c_str());
}

void use_prepared_outputs(std::vector<PreparedOutput> prepared, PreparedOutputKeeper with) {
  outputs = std::move(prepared);
  keeper = std::move(with);
}

std::optional<fs::path> prepared_part(const fs::path& name) {
  const auto output = std::ranges::find(outputs, name, &PreparedOutput::name);
  return output != outputs.end() ? std::optional(output->part) : std::nullopt;
}

bool is_prepared(const fs::path& part) noexcept { return find(part) < outputs.size(); }

std::error_code lost_part() noexcept {
  static const LostPart category;
  return {1, category};
}

std::error_code rename_part(const fs::path& part, const fs::path& name) {
  if (const std::error_code refusal = withheld(name)) return refusal;
  if (const std::size_t number = find(part); number < outputs.size()) return keeper.name(number);
  keep_mode(part, name);
  std::error_code error;
  fs::rename(part, name, error);
  return error;
}

void discard_part(const fs::path& part) noexcept {
  if (const std::size_t number = find(part); number < outputs.size()) {
    try {
      keeper.remove(number);
    } catch (const std::exception&) {  // that process has ended, and has removed it
    }
    return;
  }
  std::error_code ignored;
  fs::remove(part, ignored);
}

}  // namespace common
