#include "common/confine/Landlock.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>

namespace common {
namespace {

// linux/landlock.h of version 6.
struct RulesetAttributes {
  std::uint64_t files, network, scopes;
};
struct [[gnu::packed]] PathRule {
  std::uint64_t allowed;
  std::int32_t descriptor;
};
constexpr int kPathRule = 1;
constexpr unsigned kAskVersion = 1;

constexpr std::uint64_t bit(int n) { return std::uint64_t{1} << n; }
constexpr std::uint64_t kWriteFile = bit(1), kReadFile = bit(2), kReadFolder = bit(3), kRemoveFolder = bit(4),
                        kRemoveFile = bit(5), kMakeFolder = bit(7), kMakeFile = bit(8), kTruncate = bit(14),
                        kIoctl = bit(15);
constexpr std::uint64_t kExecute = bit(0);
constexpr int kFileRightsOfVersion[] = {0, 13, 14, 15, 15};  // from version 5 on: 16
constexpr std::uint64_t kOfFiles = kExecute | kWriteFile | kReadFile | kTruncate | kIoctl;

constexpr std::uint64_t kReadBelow = kReadFile | kReadFolder;
constexpr std::uint64_t kWriteOne = kReadFile | kWriteFile | kTruncate | kIoctl;
constexpr std::uint64_t kWriteBelow =
    kReadBelow | kWriteFile | kTruncate | kMakeFile | kMakeFolder | kRemoveFile | kRemoveFolder;

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error("the process cannot be confined: " + what + ": " + std::strerror(errno));
}

std::uint64_t rights_of(int version) { return bit(version >= 5 ? 16 : kFileRightsOfVersion[version]) - 1; }

class Ruleset {
 public:
  explicit Ruleset(const RulesetAttributes& attributes, std::size_t bytes)
      : handled_(attributes.files),
        descriptor_(static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, bytes, 0U))) {
    if (descriptor_ < 0) fail("Landlock");
  }
  ~Ruleset() { ::close(descriptor_); }
  Ruleset(const Ruleset&) = delete;
  Ruleset& operator=(const Ruleset&) = delete;

  void allow(const std::filesystem::path& path, std::uint64_t rights) const {
    const int file = ::open(path.c_str(), O_PATH | O_CLOEXEC);
    if (file < 0) return;
    struct stat status {};
    if (::fstat(file, &status) == 0 && !S_ISDIR(status.st_mode)) rights &= kOfFiles;
    const PathRule rule{rights & handled_, file};
    const long done = ::syscall(SYS_landlock_add_rule, descriptor_, kPathRule, &rule, 0U);
    const int failure = errno;
    ::close(file);
    errno = failure;
    // Pipes and sockets lie in no file system that rules are about; they need none.
    if (done != 0 && errno != EBADFD) fail("Landlock, " + path.string());
  }
  void enforce() const {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
        ::syscall(SYS_landlock_restrict_self, descriptor_, 0U) != 0)
      fail("Landlock");
  }

 private:
  std::uint64_t handled_;
  int descriptor_;
};

}  // namespace

int landlock_version() noexcept {
  const long version = ::syscall(SYS_landlock_create_ruleset, nullptr, 0, kAskVersion);
  return version > 0 ? static_cast<int>(version) : 0;
}

void restrict_files(const Confinement& confinement, int version) {
  const bool all_calls = confinement.calls == Confinement::Calls::kAny;
  RulesetAttributes attributes{.files = rights_of(version), .network = 0, .scopes = 0};
  // Programs that a confined process may start must be able to run, and drivers take ioctl().
  if (all_calls) attributes.files &= ~(kExecute | kIoctl);
  if (confinement.calls == Confinement::Calls::kPictures) attributes.files &= ~kIoctl;
  if (version >= 4 && !all_calls) attributes.network = 3;   // bind, connect
  if (version >= 6) attributes.scopes = all_calls ? 2 : 3;  // abstract sockets (1), signals (2)
  const std::size_t bytes = version >= 6 ? 24 : version >= 4 ? 16 : 8;
  const Ruleset rules(attributes, bytes);
  for (const auto& path : confinement.read) rules.allow(path, kReadBelow);
  for (const auto& path : confinement.write) rules.allow(path, kWriteOne);
  for (const auto& path : confinement.write_folders) rules.allow(path, kWriteBelow);
  rules.enforce();
}

}  // namespace common
