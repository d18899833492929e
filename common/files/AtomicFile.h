// Replaces a file as a whole: readers see the old content or the new, never a part.
#pragma once

#include <filesystem>
#include <string_view>
#include <system_error>

namespace common {

// Writes `bytes` to a temporary file beside `path` and renames it. On failure the old file stays and nothing
// is left behind. The new file has the permissions of the old one, which must be writable. A device, a pipe
// or a symbolic link is written in place: it must not be replaced by a file. A path of an open descriptor
// (/dev/stdout, /dev/fd/3) is written to that descriptor.
[[nodiscard]] std::error_code replace_file(const std::filesystem::path& path, std::string_view bytes);

// The temporary file.
std::filesystem::path part_of(const std::filesystem::path& path);

// True for what replace_file() writes in place.
bool is_special_file(const std::filesystem::path& path) noexcept;
// True for "/dev/stdout" and the other names of this process's descriptor 1.
bool is_standard_output(const std::filesystem::path& path);

}  // namespace common
