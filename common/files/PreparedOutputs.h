// Outputs of a process that gives up its right to create, rename and remove files before it reads foreign
// ones. Each is written to a file that exists before, its part; another process then gives that its name.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace common {

struct PreparedOutput {
  std::string subject;  // of errors; empty: create_part() leaves the part to the output's writer
  std::filesystem::path name, part;
  bool in_place = false;  // a link, a pipe or a device: `part` is what the name leads to
  bool is_new = false;    // to be created, and to be removed if it gets no name or, in place, no content
};

// Why the part, whose name is the output's with an ending, cannot have it; empty if it can.
std::string too_long_for_part(const std::filesystem::path& name, const std::filesystem::path& part);

// Creates nothing. Throws UserError, which begins with `subject`.
PreparedOutput prepare_output(const std::string& subject, const std::filesystem::path& name,
                              const std::filesystem::path& part);
// For the process that keeps the rights, and that outlives one which is killed: it creates the parts, and
// removes what it has created. A part that a killed process of this user has left is taken as it is, and is
// not new.
std::error_code create_part(PreparedOutput&) noexcept;
std::error_code name_part(const PreparedOutput&) noexcept;
void remove_part(const PreparedOutput&) noexcept;

// From here on the functions below pass these outputs, by their numbers, to `name` and `remove`.
struct PreparedOutputKeeper {
  std::function<std::error_code(std::size_t)> name;
  std::function<void(std::size_t)> remove;
};
void use_prepared_outputs(std::vector<PreparedOutput>, PreparedOutputKeeper);

// The part of the output of that name; nullopt: it is not prepared.
std::optional<std::filesystem::path> prepared_part(const std::filesystem::path& name);
bool is_prepared(const std::filesystem::path& part) noexcept;
// An error if `name` is a file that may not be written, which renaming would replace all the same.
std::error_code refused_output(const std::filesystem::path& name) noexcept;
// The permissions to create a part with: those of the file that it will replace, if there is one.
unsigned part_mode(const std::filesystem::path& name) noexcept;
// The error of a part that somebody has removed or replaced: what was written to it is lost.
std::error_code lost_part() noexcept;
// Like rename() and remove(), for prepared parts and for others. The new file has the permissions of the one
// that it replaces.
std::error_code rename_part(const std::filesystem::path& part, const std::filesystem::path& name);
void discard_part(const std::filesystem::path& part) noexcept;

}  // namespace common
