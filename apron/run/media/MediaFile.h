// Reads and writes whole files, and provides the checks common to all formats. Failures throw MediaError.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

// Paths are relative to the current directory.
std::string read_file(const std::string& path);

// Replaces the file atomically: a failure keeps the old file and leaves no partial one.
void write_file(const std::string& path, std::string_view bytes);

// The part of the file name after the last dot, in lower case; empty if there is none.
std::string extension(std::string_view path);

// Refuses a file whose array does not have the plane's shape. The message states both.
void require_shape(const std::string& path, std::uint64_t width, std::uint64_t height,
                   const vm::Plane& plane);

[[noreturn]] void throw_refused(const std::string& path, const std::string& reason);

}  // namespace apron::run
