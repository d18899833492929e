// The name of a file without links.
#pragma once

#include <filesystem>
#include <system_error>

namespace common {

// Absolute, also of a file that does not exist: a link to it stands for the file that it names. Empty if the
// links have no end or a folder cannot be read, which the error code shows.
std::filesystem::path real_path(const std::filesystem::path&);
std::filesystem::path real_path(const std::filesystem::path&, std::error_code&);
// The file that an output of that name replaces: the target of a link, which stays, or the name itself.
std::filesystem::path replaced_path(const std::filesystem::path& name);
// True if the path leads nowhere, whoever may read what: too long a name, endless links, a file as a folder.
bool leads_nowhere(const std::error_code&) noexcept;

}  // namespace common
