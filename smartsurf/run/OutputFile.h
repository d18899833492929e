// The files that a run writes besides its recordings: refused before the run when they cannot be written, and
// replaced as a whole after it.
#pragma once

#include <string>

namespace smartsurf::run {

// Both throw scene::InputError that names the flag, the file and the reason.

// Checks that the file's folder exists and is writable; writes nothing.
void require_writable(const std::string& flag, const std::string& file);
// Replaces the file as a whole (common/files/AtomicFile.h).
void replace_output_file(const std::string& flag, const std::string& file, const std::string& text);

}  // namespace smartsurf::run
