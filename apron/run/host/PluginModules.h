// Loads and calls the shared objects that !module names, through the C interface of apron_plugin.h.
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
  // Searches each directory for NAME, NAME.so and libNAME.so, where NAME may be a path. Does nothing if the
  // module is already loaded. Returns a one-line error message, or empty.
  std::string load(const std::string& name, const std::vector<std::string>& directories);

  // The module must be loaded. Writes to the plane `to` or to `value`, whichever is not null. Returns an
  // error message, or empty.
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
