// Reads a whole file that a user names, with an upper bound on its size.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>

namespace common {

// More than any program, script or table of numbers needs.
inline constexpr std::size_t kMaxTextBytes = std::size_t{16} << 20;

// Replaces `bytes` by the file's content, and notes the file as an input (Inputs.h). On failure it holds the
// part that could be read; errc::file_too_large: there is more than `max_bytes`; not_a_regular_file(): a
// pipe, a device or a socket, which is never waited for.
[[nodiscard]] std::error_code read_file(const std::filesystem::path& path, std::size_t max_bytes,
                                        std::string& bytes);

std::error_code not_a_regular_file() noexcept;

}  // namespace common
