// Output files of a run other than recordings: checked for writability before the run and replaced atomically
// after it.
#pragma once

#include <string>

namespace smartsurf::run {

// Both throw scene::InputError, which names the flag, the file and the reason.

// Checks that the file's folder exists and is writable; writes nothing.
void require_writable(const std::string& flag, const std::string& file);
// Replaces the file atomically (common/files/AtomicFile.h). Throws std::runtime_error if it is standard
// output.
void replace_output_file(const std::string& flag, const std::string& file, const std::string& text);

}  // namespace smartsurf::run
