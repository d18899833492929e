// File access within the folders that the sandbox allows. Internal to this module.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// The file's content. On failure, returns nullopt and sets `reason`, a clause such as "does not exist".
std::optional<std::string> read_text_file(const std::filesystem::path& path, std::string& reason);

struct NamedFile {
  std::string name;  // for messages
  std::string content;
};
// Reads a file that the script names. Throws ScriptError, which begins with `subject`, if it cannot be read
// or the sandbox denies access.
NamedFile read_sandboxed_file(Sandbox&, const std::string& subject, const std::string& path);
// The real path of a file that the script may read; the file need not exist. Throws ScriptError, which begins
// with `subject`, if the path is not a regular file or the sandbox denies access.
std::filesystem::path resolve_readable_path(const Sandbox&, const std::string& subject,
                                            const std::string& path);

void bind_file_access(lua_State* L);  // require, dofile, io, restricted to the sandbox's folders

}  // namespace smartsurf::script
