// Reads a whole file that a user names, with an upper bound on its size.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>

namespace common {

// More than any program, script or table of numbers needs. The bound ends a read of /dev/zero.
inline constexpr std::size_t kMaxTextBytes = std::size_t{16} << 20;

// Replaces `bytes` by the file's content. On failure it holds the part that could be read;
// errc::file_too_large: there is more than `max_bytes`.
[[nodiscard]] std::error_code read_file(const std::filesystem::path& path, std::size_t max_bytes,
                                        std::string& bytes);

}  // namespace common
