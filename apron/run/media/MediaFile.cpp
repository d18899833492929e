#include "apron/run/media/MediaFile.h"

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "apron/program/Program.h"
#include "apron/run/media/MediaError.h"
#include "apron/vm/NumberFormat.h"
#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"
#include "common/text/Words.h"

namespace apron::run {
namespace {

[[noreturn]] void throw_system_error(const std::string& path, const char* action, vm::HostStatus status) {
  throw MediaError(status, std::string("cannot ") + action + " '" + path + "': " + std::strerror(errno));
}

}  // namespace

void require_size(const std::string& path, std::uint64_t width, std::uint64_t height,
                  const vm::Plane* plane) {
  if (plane != nullptr) return require_shape(path, width, height, *plane);
  if (width == 0 || height == 0 || width > program::kMaxCells / height)
    throw_refused(path, "is " + std::to_string(width) + "x" + std::to_string(height) + ", not of 1 to " +
                            std::to_string(program::kMaxCells) + " pixels");
}

void throw_refused(const std::string& path, const std::string& reason) {
  throw MediaError(vm::HostStatus::kRefused, "'" + path + "' " + reason);
}

std::string read_file(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw_refused(path, "is a directory");
  std::string bytes;
  if (const std::error_code failure = common::read_file(path, max_bytes, bytes)) {
    if (failure == common::not_a_regular_file()) throw_refused(path, "is not a regular file");
    errno = failure.value();
    const bool disk = failure == std::errc::io_error;
    throw_system_error(path, "read", disk ? vm::HostStatus::kFailed : vm::HostStatus::kRefused);
  }
  return bytes;
}

void write_file(const std::string& path, std::string_view bytes) {
  if (const std::error_code error = common::replace_file(path, bytes)) {
    errno = error.value();
    // A wrong path is the program's error (kRefused); a full or failing disk is the system's (kFailed).
    const bool disk = error == std::errc::no_space_on_device || error == std::errc::io_error ||
                      error == std::errc::file_too_large;
    throw_system_error(path, "write", disk ? vm::HostStatus::kFailed : vm::HostStatus::kRefused);
  }
}

std::string extension(std::string_view path) {
  const std::size_t dot = path.find_last_of("./");
  if (dot == std::string_view::npos || path[dot] == '/') return {};
  return common::lower_case(std::string(path.substr(dot + 1)));
}

void require_shape(const std::string& path, std::uint64_t width, std::uint64_t height,
                   const vm::Plane& plane) {
  if (width != plane.width || height != plane.height)
    throw_refused(path, "is " + std::to_string(width) + "x" + std::to_string(height) +
                            ", but the register is " + vm::format_shape(plane));
}

void store_cell(const std::string& path, const vm::Plane& to, std::uint32_t x, std::uint32_t y,
                double value) {
  if (!program::is_cell_value(to.type, value))
    throw_refused(path, "holds " + vm::format_number(value) + " at column " + std::to_string(x) + ", row " +
                            std::to_string(y) + ", which is no " +
                            std::string(program::cell_type_name(to.type)));
  vm::with_cell_type(to.type, [&](auto cell) {
    using T = decltype(cell);
    to.cells<T>(y)[x] = static_cast<T>(value);
  });
}

}  // namespace apron::run
