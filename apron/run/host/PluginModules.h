// Shared objects loaded by !module, with the C interface of apron_plugin.h.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/vm/Host.h"

struct apron_call;

namespace apron::run {

class PluginModules {
 public:
  // Looks for NAME, NAME.so and libNAME.so in each directory, or for the path where the name has a '/'. "" or
  // what is wrong, in one line. Loading one again does nothing.
  std::string load(const std::string& name, const std::vector<std::string>& directories);

  // "" or what is wrong. The module must be loaded.
  std::string call(std::string_view module, int operation, std::span<const vm::PluginArgument> arguments,
                   vm::Plane to, float* value) const;

 private:
  struct LibraryCloser {
    void operator()(void* library) const noexcept;
  };
  struct Module {
    std::unique_ptr<void, LibraryCloser> library;
    int (*call)(apron_call*) = nullptr;
  };
  std::map<std::string, Module, std::less<>> modules_;
};

}  // namespace apron::run
