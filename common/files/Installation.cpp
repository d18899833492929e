#include "common/files/Installation.h"

#include <dlfcn.h>
#include <link.h>
#include <sys/auxv.h>

#include <string>
#include <system_error>

namespace common {
namespace {

namespace fs = std::filesystem;

// The shared object that contains this code; "" in a program.
fs::path module_path() {
  Dl_info info{};
  link_map* map = nullptr;
  if (dladdr1(reinterpret_cast<void*>(&module_path), &info, reinterpret_cast<void**>(&map),
              RTLD_DL_LINKMAP) == 0 ||
      map == nullptr)
    return {};
  return map->l_name;
}

// A module lies several folders below the installation, a program one.
fs::path shared_folder() {
  std::error_code error;
  const fs::path module = module_path();
  if (module.empty()) return program_path().parent_path().parent_path() / "share" / "smartsurf";
  for (fs::path folder = fs::absolute(module, error).parent_path(); folder != folder.root_path();
       folder = folder.parent_path())
    if (const fs::path found = folder / "share" / "smartsurf"; fs::is_directory(found, error)) return found;
  return {};
}

}  // namespace

fs::path program_path() {
  std::error_code error;
  if (fs::path path = fs::read_symlink("/proc/self/exe", error); !error) return path;
  const auto* const executed = reinterpret_cast<const char*>(getauxval(AT_EXECFN));
  if (executed == nullptr) return {};
  fs::path path = fs::canonical(executed, error);
  return error ? fs::path() : path;
}

fs::path installed_file(const fs::path& name) {
  std::error_code error;
  for (const fs::path& folder : {shared_folder(), fs::path(SMARTSURF_SOURCE_SCRIPTS)})
    if (fs::path file = folder / name; !folder.empty() && fs::exists(file, error)) return file;
  return {};
}

fs::path font_file(const char* name) {
  std::error_code error;
  fs::path file = fs::path("/usr/share/fonts/truetype/dejavu") / name;
  return fs::exists(file, error) ? file : installed_file(fs::path("fonts") / name);
}

}  // namespace common
