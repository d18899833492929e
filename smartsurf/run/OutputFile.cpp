#include "smartsurf/run/OutputFile.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "common/files/AtomicFile.h"
#include "common/files/PreparedOutputs.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void throw_input_error(const std::string& flag, const std::string& file,
                                    const std::string& reason) {
  throw scene::InputError(fmt::format("{} {}: {}", flag, file, reason));
}

}  // namespace

void require_writable(const std::string& flag, const std::string& file) {
  if (file == "-") throw_input_error(flag, file, "is no file's name (./- is one; /dev/stdout for a pipe)");
  std::error_code ignored;
  if (fs::is_directory(file, ignored))
    throw_input_error(flag, file, "is a folder: give the name of a file in it");
  const fs::path parent = fs::path(file).parent_path(), folder = parent.empty() ? fs::path(".") : parent;
  if (!fs::is_directory(folder, ignored))
    throw_input_error(flag, file, "there is no folder " + folder.string());
  // Special files and links are written in place. Everything else, including the target of a dangling link,
  // is created in its folder.
  const std::string target =
      fs::exists(file, ignored) && common::is_special_file(file) ? file : folder.string();
  if (access(target.c_str(), W_OK) != 0)
    throw_input_error(flag, file, std::string("cannot be written: ") + std::strerror(errno));
  if (const std::error_code refusal = common::refused_output(file))
    throw_input_error(flag, file, "cannot be written: " + refusal.message());
}

void replace_output_file(const std::string& flag, const std::string& file, const std::string& text) {
  const std::error_code error = common::replace_file(file, text);
  if (!error) return;
  if (common::is_standard_output(file))
    throw std::runtime_error(fmt::format("{}: cannot write the output: {}", flag, error.message()));
  throw_input_error(flag, file, "cannot be written: " + error.message());
}

}  // namespace smartsurf::run
