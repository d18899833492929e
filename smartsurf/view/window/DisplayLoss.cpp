#include "smartsurf/view/window/DisplayLoss.h"

#include <dlfcn.h>

#include <atomic>

// Declared here because GLFW's native header includes Xlib's, which nothing else needs.
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
  // Both are needed: without the exit handler (libX11 1.7 and later), Xlib terminates the process after the
  // error handler returns.
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
