// Reads and writes whole files, and provides the checks common to all formats. Failures throw MediaError.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

constexpr std::size_t kMaxMediaBytes = std::size_t{1} << 30;

// Paths are relative to the current directory. A file of more than `max_bytes` is refused.
std::string read_file(const std::string& path, std::size_t max_bytes = kMaxMediaBytes);

// Replaces the file atomically: a failure keeps the old file and leaves no partial one.
void write_file(const std::string& path, std::string_view bytes);

// The part of the file name after the last dot, in lower case; empty if there is none.
std::string extension(std::string_view path);

// Refuses a file whose array does not have the plane's shape. The message states both.
void require_shape(const std::string& path, std::uint64_t width, std::uint64_t height,
                   const vm::Plane& plane);

// Writes one cell. Refuses a value that is none of its type.
void store_cell(const std::string& path, const vm::Plane& to, std::uint32_t x, std::uint32_t y, double value);

// If there is a plane, refuses another shape; otherwise an image without pixels or with more than
// program::kMaxCells.
void require_size(const std::string& path, std::uint64_t width, std::uint64_t height, const vm::Plane* plane);

// Throws MediaError: "'PATH' REASON".
[[noreturn]] void throw_refused(const std::string& path, const std::string& reason);

}  // namespace apron::run
