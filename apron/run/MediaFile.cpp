#include "apron/run/MediaFile.h"

#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "apron/run/MediaError.h"

namespace apron::run {
namespace {

struct Close {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

[[noreturn]] void system_error(const std::string& path, const char* doing, vm::HostStatus status) {
  throw MediaError(status, std::string("cannot ") + doing + " '" + path + "': " + std::strerror(errno));
}

}  // namespace

void refuse(const std::string& path, const std::string& why) {
  throw MediaError(vm::HostStatus::kRefused, "'" + path + "' " + why);
}

std::string read_file(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) refuse(path, "is a directory");
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) system_error(path, "read", vm::HostStatus::kRefused);
  std::string bytes;
  char chunk[1 << 16];
  while (const std::size_t n = std::fread(chunk, 1, sizeof chunk, file.get())) bytes.append(chunk, n);
  if (std::ferror(file.get()) != 0) system_error(path, "read", vm::HostStatus::kFailed);
  return bytes;
}

void write_file(const std::string& path, std::string_view bytes) {
  const std::string part = path + ".part";
  File file(std::fopen(part.c_str(), "wb"));
  if (!file) system_error(path, "write", vm::HostStatus::kRefused);
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
  if (std::fclose(file.release()) != 0 || !written || std::rename(part.c_str(), path.c_str()) != 0) {
    const int why = errno;
    std::remove(part.c_str());
    errno = why;
    system_error(path, "write", vm::HostStatus::kFailed);
  }
}

std::string extension(std::string_view path) {
  const std::size_t dot = path.find_last_of("./");
  if (dot == std::string_view::npos || path[dot] == '/') return {};
  std::string ending(path.substr(dot + 1));
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

void require_shape(const std::string& path, std::uint64_t width, std::uint64_t height,
                   const vm::Plane& plane) {
  if (width != plane.width || height != plane.height)
    refuse(path, "is " + std::to_string(width) + "x" + std::to_string(height) + ", but the register is " +
                     vm::format_shape(plane));
}

}  // namespace apron::run
