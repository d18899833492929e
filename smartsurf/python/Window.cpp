#include <string>

#include "smartsurf/python/Bindings.h"
#include "smartsurf/python/Pictures.h"
#include "smartsurf/python/Simulation.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::python {
namespace {

// The simulator's window, which shows a simulation that Python steps. Main thread only, one per process.
class Window {
 public:
  Window(const Simulation& simulation, const std::string& title, int width, int height,
         const CameraChoice& camera)
      : window_(simulation.environment().scene(), title, width, height) {
    view::ViewSettings settings;
    settings.camera = camera_view(camera.first);
    window_.apply(settings);
  }
  // False once the user has closed it or the display is lost; then it must not be called again.
  bool show(const Simulation& simulation) {
    return simulation.read([this](const Environment& environment) {
      view::Status status;
      status.mode = "Python";
      status.metrics = environment.metrics();
      const view::Commands commands = window_.render_frame(
          {environment.simulation().snapshot(), environment.simulation().catalogue()}, status);
      return !commands.quit && !commands.display_lost;
    });
  }

 private:
  view::Window window_;
};

}  // namespace

void bind_window(py::module_& m) {
  py::class_<Window>(m, "Window")
      .def(py::init<const Simulation&, const std::string&, int, int, const CameraChoice&>())
      .def("show", &Window::show);
}

}  // namespace smartsurf::python
