// The files that a run writes besides its recordings: refused before the run when they cannot be written, and
// whole or not there after it.
#pragma once

#include <string>

namespace smartsurf::run {

// Both throw scene::InputError that names the flag, the file and the reason.

// Looks whether the file's folder is there and may be written; writes nothing.
void require_writable(const std::string& flag, const std::string& file);
// Writes the file in one piece or not at all; into a device or pipe as it is.
void replace_output_file(const std::string& flag, const std::string& file, const std::string& text);

}  // namespace smartsurf::run
