#include "smartsurf/run/OutputFile.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void throw_input_error(const std::string& flag, const std::string& file,
                                    const std::string& reason) {
  throw scene::InputError(fmt::format("{} {}: {}", flag, file, reason));
}

// 0, or the number of what went wrong.
int try_write(const std::string& file, const std::string& text) {
  errno = 0;
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  return out ? 0 : errno != 0 ? errno : EIO;
}

// A device, a pipe, a link such as /dev/stdout: what is there must not be replaced by a file.
bool is_special(const std::string& file) {
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(file, ignored);
  return fs::exists(status) && !fs::is_regular_file(status);
}

}  // namespace

void require_writable(const std::string& flag, const std::string& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored))
    throw_input_error(flag, file, "is a folder: give the name of a file in it");
  const fs::path parent = fs::path(file).parent_path(), folder = parent.empty() ? fs::path(".") : parent;
  if (!fs::is_directory(folder, ignored))
    throw_input_error(flag, file, "there is no folder " + folder.string());
  // Through a link that leads nowhere yet a file may be made.
  const std::string target = fs::exists(file, ignored) && is_special(file) ? file : folder.string();
  if (access(target.c_str(), W_OK) != 0)
    throw_input_error(flag, file, std::string("cannot be written: ") + std::strerror(errno));
}

void replace_output_file(const std::string& flag, const std::string& file, const std::string& text) {
  const bool special = is_special(file);
  const std::string temporary_file = special ? file : file + ".part";
  int error = try_write(temporary_file, text);
  if (!special && error == 0 && std::rename(temporary_file.c_str(), file.c_str()) != 0) error = errno;
  if (!special && error != 0) std::remove(temporary_file.c_str());
  if (error != 0) throw_input_error(flag, file, std::string("cannot be written: ") + std::strerror(error));
}

}  // namespace smartsurf::run
