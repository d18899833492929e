#include "smartsurf/view/window/DisplayLoss.h"

#include <dlfcn.h>

#include <atomic>

// GLFW's own; its header would need Xlib's, which nothing else here does.
extern "C" void* glfwGetX11Display(void);

namespace smartsurf::view {
namespace {

std::atomic<bool> lost{false};

int on_error(void*) {
  lost = true;
  return 0;
}
void on_exit(void*, void*) { lost = true; }

template <class Function>
Function* find(void* library, const char* name) {
  return reinterpret_cast<Function*>(dlsym(library, name));
}

}  // namespace

void detect_display_loss() {
  lost = false;
  void* const display = glfwGetX11Display();
  void* const library = dlopen("libX11.so.6", RTLD_LAZY | RTLD_NOLOAD);
  if (display == nullptr || library == nullptr) return;
  using SetHandler = void*(int (*)(void*));
  using SetExitHandler = void(void*, void (*)(void*, void*), void*);
  // Without the second, which Xlib has since 1.7, returning from the first ends the process all the same.
  auto* const set_exit = find<SetExitHandler>(library, "XSetIOErrorExitHandler");
  auto* const set_handler = find<SetHandler>(library, "XSetIOErrorHandler");
  if (set_exit != nullptr && set_handler != nullptr) {
    set_handler(on_error);
    set_exit(display, on_exit, nullptr);
  }
  dlclose(library);
}

bool display_lost() noexcept { return lost; }

}  // namespace smartsurf::view
