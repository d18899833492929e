// Reads and writes whole files, and checks that all formats share. All functions throw MediaError.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

// Paths are relative to the current directory.
std::string read_file(const std::string& path);

// Writes beside `path` and renames, so that a failure leaves no half-written file and keeps the old one.
void write_file(const std::string& path, std::string_view bytes);

// The name's ending after the last dot, in lower case; "" without one.
std::string extension(std::string_view path);

// Refuses a file whose array is not of the register's shape, naming both.
void require_shape(const std::string& path, std::uint64_t width, std::uint64_t height,
                   const vm::Plane& plane);

[[noreturn]] void throw_refused(const std::string& path, const std::string& reason);

}  // namespace apron::run
