#include "smartsurf/view/window/DisplayLoss.h"

#include <dlfcn.h>

#include <atomic>

// GLFW's own; its header would need Xlib's, which nothing else here does.
extern "C" void* glfwGetX11Display(void);

namespace smartsurf::view {
namespace {

std::atomic<bool> display_lost_flag{false};

int on_io_error(void*) {
  display_lost_flag = true;
  return 0;
}
void on_io_error_exit(void*, void*) { display_lost_flag = true; }

template <class Function>
Function* load_symbol(void* library, const char* name) {
  return reinterpret_cast<Function*>(dlsym(library, name));
}

}  // namespace

void detect_display_loss() {
  display_lost_flag = false;
  void* const display = glfwGetX11Display();
  void* const library = dlopen("libX11.so.6", RTLD_LAZY | RTLD_NOLOAD);
  if (display == nullptr || library == nullptr) return;
  using SetHandler = void*(int (*)(void*));
  using SetExitHandler = void(void*, void (*)(void*, void*), void*);
  // Without the second, which Xlib has since 1.7, returning from the first ends the process all the same.
  auto* const set_exit = load_symbol<SetExitHandler>(library, "XSetIOErrorExitHandler");
  auto* const set_handler = load_symbol<SetHandler>(library, "XSetIOErrorHandler");
  if (set_exit != nullptr && set_handler != nullptr) {
    set_handler(on_io_error);
    set_exit(display, on_io_error_exit, nullptr);
  }
  dlclose(library);
}

bool display_lost() noexcept { return display_lost_flag; }

}  // namespace smartsurf::view
