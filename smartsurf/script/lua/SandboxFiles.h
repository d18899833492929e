// Reads files in the script's folder. Internal to this module.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace smartsurf::script {

struct ScriptContext;

// The file's text; nullopt, and in `problem` what is wrong with it ("does not exist"), when it cannot be had.
std::optional<std::string> read_text_file(const std::filesystem::path& path, std::string& reason);

struct NamedFile {
  std::string name;  // as messages call the file
  std::string content;
};
// The text of a file that a script names, where its sandbox lets it read. Throws Problem, naming `what`.
NamedFile read_sandboxed_file(const ScriptContext&, const std::string& subject, const std::string& path);
// Where a file is that the script may read; it need not exist, but is nothing else than a file. Throws
// Problem, which begins with `what`, where the sandbox refuses.
std::filesystem::path resolve_readable_path(const ScriptContext&, const std::string& subject,
                                            const std::string& path);

}  // namespace smartsurf::script
