#include "common/files/AtomicFile.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <optional>
#include <string>

#include "common/files/Inputs.h"
#include "common/files/PreparedOutputs.h"

namespace common {
namespace {

namespace fs = std::filesystem;

std::error_code last_error() { return {errno, std::generic_category()}; }

std::error_code write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(file, bytes.data(), bytes.size());
    if (n > 0)
      bytes.remove_prefix(n);
    else if (n < 0 && errno != EINTR)
      return last_error();
  }
  return {};
}

std::error_code write_all(const fs::path& path, std::string_view bytes, int creation, unsigned mode) {
  // A named pipe that nobody reads is an error: the call would wait for a reader.
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK | creation, mode);
  if (file < 0) return errno == ENXIO ? std::make_error_code(std::errc::broken_pipe) : last_error();
  std::error_code error;
  if (::fcntl(file, F_SETFL, 0) != 0) error = last_error();
  if (!error) error = write_all(file, bytes);
  if (::close(file) != 0 && !error) error = last_error();
  return error;
}

// The open descriptor that a path stands for. Opened by its path, a redirected stream would start again at
// the beginning of its file.
std::optional<int> descriptor_of(const std::string& path) {
  if (path == "/dev/stdout") return STDOUT_FILENO;
  if (path == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!path.starts_with(folder)) continue;
    const char* const end = path.data() + path.size();
    int descriptor = 0;
    const auto [rest, error] = std::from_chars(path.data() + folder.size(), end, descriptor);
    if (error == std::errc() && rest == end) return descriptor;
  }
  return std::nullopt;
}

// After what the program has printed.
std::error_code append_to(int descriptor, std::string_view bytes) {
  if (descriptor == STDOUT_FILENO && std::fflush(stdout) != 0) return last_error();
  return write_all(descriptor, bytes);
}

}  // namespace

bool is_special_file(const fs::path& path) noexcept {
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(path, ignored);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

bool is_standard_output(const fs::path& path) { return descriptor_of(path) == STDOUT_FILENO; }

// The process id keeps two processes that write the same file apart.
fs::path part_of(const fs::path& path) { return path.string() + ".part" + std::to_string(::getpid()); }

std::error_code replace_file(const fs::path& path, std::string_view bytes) {
  if (const std::error_code refusal = withheld(path)) return refusal;
  if (const std::optional<int> descriptor = descriptor_of(path)) return append_to(*descriptor, bytes);
  if (is_special_file(path)) return write_all(path, bytes, O_CREAT | O_TRUNC, 0666);
  std::error_code error;
  if (fs::is_directory(path, error)) return std::make_error_code(std::errc::is_a_directory);
  if (const std::error_code refusal = refused_output(path)) return refusal;
  const std::optional<fs::path> prepared = prepared_part(path);
  const fs::path part = prepared ? *prepared : part_of(path);
  error.clear();
  // Removed and then created with O_EXCL, so that the bytes never go through a link that another user put
  // there.
  if (!prepared) fs::remove(part, error);
  if (!error) error = write_all(part, bytes, prepared ? O_TRUNC : O_CREAT | O_EXCL, part_mode(path));
  // A confined process may write to the file that was there, whatever has its name now.
  if (prepared && (error == std::errc::no_such_file_or_directory || error == std::errc::permission_denied))
    error = lost_part();
  if (!error) error = rename_part(part, path);
  if (error) discard_part(part);
  return error;
}

}  // namespace common
