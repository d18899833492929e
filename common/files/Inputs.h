// The files that this process reads, so that none of its outputs replaces one of them.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <system_error>

namespace common {

// Remembers a file by device and inode. read_file() does it; other readers call it with the file that they
// open. May be called on any thread.
void note_input(int descriptor) noexcept;
void note_input(const std::filesystem::path&) noexcept;
// Files that are read from here on are not remembered, because a program may overwrite what it has loaded
// itself.
void end_of_inputs() noexcept;

// True if the path names, by whatever link, a file that was noted.
bool is_input(const std::filesystem::path&) noexcept;

struct NamedOutput {
  std::string flag;  // "--stats"
  std::filesystem::path file;
};
// Call when everything is loaded and before anything is written. Throws UserError if an output is an input,
// or if two outputs are one file. Pipes and devices may be shared.
void require_separate_outputs(std::span<const NamedOutput>);
// Files that are read or written otherwise after that call must be none of the outputs: true if the path
// names one, by whatever link. That output is then withheld.
bool withhold_output(const std::filesystem::path&) noexcept;
// Why the output is not to be written.
std::error_code withheld(const std::filesystem::path&) noexcept;

}  // namespace common
