#include "common/process/WindowLibrary.h"

#include <dlfcn.h>

#include <cstdlib>

#include "common/error/UserError.h"

namespace common {

void require_window_library() {
  const char* const display = std::getenv("DISPLAY");
  if (display == nullptr || *display == '\0') return;
  void* const library = dlopen("libX11.so.6", RTLD_LAZY);
  if (library == nullptr)
    throw UserError("--window: libX11.so.6 is not installed: install the packages libx11-6 libgl1 libegl1");
  dlclose(library);
}

}  // namespace common
