#include "apron/run/host/PluginModules.h"

#include <dlfcn.h>

#include <array>
#include <cstring>
#include <filesystem>

#include "apron/program/Program.h"
#include "apron/run/apron_plugin.h"
#include "common/arithmetic/StandardArithmetic.h"
#include "common/files/ElfFile.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

namespace fs = std::filesystem;

std::string find_library_file(const std::string& name, const std::vector<std::string>& directories) {
  std::error_code error;
  const bool is_path = name.find('/') != std::string::npos;
  for (const std::string& directory : directories) {
    const fs::path base = directory.empty() ? fs::path(".") : fs::path(directory);
    for (const std::string& file : {name, name + ".so", "lib" + name + ".so"}) {
      const fs::path path = is_path && fs::path(name).is_absolute() ? fs::path(file) : base / file;
      if (fs::is_regular_file(path, error)) return fs::absolute(path, error).string();
    }
  }
  return {};
}

}  // namespace

void PluginModules::LibraryCloser::operator()(void* library) const noexcept { dlclose(library); }

std::string PluginModules::load(const std::string& name, const std::vector<std::string>& directories) {
  if (modules_.find(name) != modules_.end()) return {};
  const std::string path = find_library_file(name, directories);
  if (path.empty()) {
    std::string searched;
    for (const std::string& directory : directories)
      searched += (searched.empty() ? "" : ", ") + (directory.empty() ? std::string(".") : directory);
    return "there is no module '" + name + "': neither " + name + ".so nor lib" + name + ".so is in " +
           searched;
  }
  if (const std::string cut = common::find_missing_segment(path); !cut.empty())
    return "the module '" + name + "' cannot be loaded: " + path + " " + cut;
  const common::StandardArithmetic arithmetic;
  Module module;
  module.library.reset(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL));
  if (module.library == nullptr) return "the module '" + name + "' cannot be loaded: " + dlerror();
  const auto version = reinterpret_cast<int (*)()>(dlsym(module.library.get(), "apron_plugin_version"));
  module.call = reinterpret_cast<int (*)(apron_call*)>(dlsym(module.library.get(), "apron_plugin_call"));
  if (version == nullptr || module.call == nullptr)
    return "the module '" + name + "' lacks apron_plugin_version or apron_plugin_call";
  if (const int module_version = version(); module_version != APRON_PLUGIN_VERSION)
    return "the module '" + name + "' was built for version " + std::to_string(module_version) +
           " of the interface; this program has version " + std::to_string(APRON_PLUGIN_VERSION);
  modules_.emplace(name, std::move(module));
  return {};
}

std::string PluginModules::call(std::string_view module, int operation,
                                std::span<const vm::PluginArgument> arguments, vm::Plane to,
                                float* value) const {
  const auto found = modules_.find(module);
  if (found == modules_.end()) return "the module '" + std::string(module) + "' is not loaded";
  std::array<apron_argument, program::kMaxPluginArguments> list{};
  std::size_t count = 0;
  for (const vm::PluginArgument& argument : arguments) {
    const vm::ConstPlane& plane = argument.plane;
    list[count++] = {plane.data, plane.width, plane.height, plane.pitch, argument.value};
  }
  apron_call call{};
  call.operation = operation;
  call.argument_count = static_cast<std::uint32_t>(count);
  call.arguments = list.data();
  call.cells = to.data;
  call.width = to.width;
  call.height = to.height;
  call.pitch = to.pitch;
  call.value = value;
  if (found->second.call(&call) == 0) return {};
  const std::string message = common::printable({call.message, strnlen(call.message, sizeof call.message)});
  return "'" + std::string(module) + "', operation " + std::to_string(operation) + ": " +
         (message.empty() ? "failed" : message);
}

}  // namespace apron::run
